"""Compiles C text to LLVM IR and to assembly, for tests of generated code."""

from __future__ import annotations

import re
import subprocess
import tempfile
from pathlib import Path

from toolchain.driver.pipeline import BackendOptions, compile_module
from toolchain.frontend.clang import clang_program, front_end_flags
from toolchain.frontend.options import CcOptions

TWO_WORDS = re.compile(r"\t(call|goto) [^w]")


def llvm(source: str, level: str = "s", *flags: str) -> str:
    """Return the optimised LLVM IR of a C text."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "unit.c"
        path.write_text(source)
        command = [
            *clang_program(),
            *front_end_flags(CcOptions(level=level, debug="-g" in flags)),
            "-ffreestanding",
            "-w",
        ]
        done = subprocess.run([*command, "-S", "-emit-llvm", str(path), "-o", "-"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def assembly(source: str, level: str = "s", **options: bool) -> str:
    """Return the assembly of a C text; options are those of `BackendOptions`."""
    flags = ["-g"] if options.get("debug") else []
    return compile_module(llvm(source, level, *flags), BackendOptions(level=level, **options))


def body(text: str, function: str) -> list[str]:
    """Return the instructions of one function, without labels and directives."""
    lines = text.split(f"_{function}:\n", 1)[1].split("\t.size", 1)[0].split("\n")
    return [line.strip() for line in lines if line.startswith("\t") and not line.startswith("\t.")]


def words(text: str, function: str) -> int:
    """Return the size of one function in program words."""
    return sum(2 if TWO_WORDS.match("\t" + line) else 1 for line in body(text, function))
