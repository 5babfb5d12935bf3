"""C code for the host: inner loops of boards and of the arena, compiled on first use and cached on disk.

Input: a C file that uses no library except libm, whose functions it declares itself. Output: callable functions. The
compiler is the clang of the `ziglang` package, without contraction of multiplications and additions. Results are
therefore bit-identical on every host and equal to those of Python's arithmetic.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from emu.dspic30f.jit.compiler import shared_compiler

FLAGS: Final = ("-std=c11", "-O2", "-march=native", "-ffp-contract=off", "-fno-math-errno", "-ffreestanding", "-fPIC",
                "-fno-stack-protector", "-Wall", "-Wextra", "-Werror")  # fmt: skip
DOUBLE, INT, ADDRESS = ctypes.c_double, ctypes.c_int64, ctypes.c_void_p
Signatures = Mapping[str, tuple[Any, Sequence[Any]]]
"""Result type and argument types of each function, by name."""

_libraries: Final[list[Any]] = []
"""Loaded libraries. They must stay referenced, because deleting one unloads its code."""


class HostCodeError(RuntimeError):
    """The C compiler is missing or rejected a file of this package."""


def functions(source: Path, signatures: Signatures) -> dict[str, Callable[..., Any]]:
    """Return the functions of a C file. They hold the GIL, so each call must be short. Raises HostCodeError."""
    return functions_of(source.read_text("utf-8"), source.stem, signatures)


def functions_of(source: str, name: str, signatures: Signatures) -> dict[str, Callable[..., Any]]:
    """Return the functions of a C text, for code that is generated. `name` appears in messages. As `functions`."""
    import llvmlite.binding as llvm

    compiler = shared_compiler()
    text = source.encode()
    key = compiler.key(2, _compiler_identity(), repr(FLAGS).encode(), text)
    code = compiler.cache.get(key)
    if code is None:
        code = _compiled(text, name)
        compiler.cache.put(key, code)
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    builder = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
    for function in signatures:
        builder.export_symbol(function)
    library = builder.link(llvm.create_lljit_compiler(use_jit_link=True), name)
    _libraries.append(library)
    return {function: ctypes.PYFUNCTYPE(result, *arguments)(int(library[function]))
            for function, (result, arguments) in signatures.items()}  # fmt: skip


def _compiler_identity() -> bytes:
    """Return what distinguishes the installed compiler: its package's file with time and size.

    The package's version would need importlib.metadata, whose import takes as long as a short run.
    """
    found = importlib.util.find_spec("ziglang")
    if found is None or found.origin is None:
        return b""
    status = os.stat(found.origin)
    return f"{found.origin} {status.st_mtime_ns} {status.st_size}".encode()


def address_of(function: Callable[..., Any]) -> int:
    """Return the host address of a function returned by `functions`, for use by native code."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0  # type: ignore[arg-type]


def _compiled(text: bytes, name: str) -> bytes:
    """Compile a C text and return the object file."""
    spec = importlib.util.find_spec("ziglang")
    if spec is None or spec.origin is None:
        raise HostCodeError("the C compiler is missing: install the Python package 'ziglang' (pip install ziglang)")
    clang = Path(spec.origin).parent / ("zig.exe" if os.name == "nt" else "zig")
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "made.o"
        source = Path(folder) / f"{name}.c"
        source.write_bytes(text)
        command = [str(clang), "clang", *FLAGS, "-c", str(source), "-o", str(made)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise HostCodeError(f"{name}.c: {done.stderr.strip()}")
        return made.read_bytes()
