"""The run-time library as an archive, built from `runtime/` on first use and kept in the user's cache folder.

Enters: assembly and C sources. Leaves: archive bytes. The cache file's name is a hash of everything the archive depends
on, and it appears by rename, so two builds at once are harmless.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path

from emu.host.paths import runtime_libraries
from toolchain.frontend.options import CcOptions, Input

RUNTIME_DIR = Path(__file__).parents[1] / "runtime"
PACKAGE_DIRS = ("toolchain", "emu/dspic30f/isa", "emu/chips")
"""What the compiled library depends on, relative to the folder that holds `toolchain`."""
UNRELATED = ("toolchain/link", "toolchain/cli.py", "toolchain/README.md")
SUFFIXES = (".py", ".c", ".cpp", ".h", ".s", ".inc", ".csv")
LEVEL = "s"
LANGUAGES = {".c": "c", ".cpp": "c++", ".s": "assembler"}


Dependency = tuple[tuple[str, ...], int, int]
"""Parts of a file's path below the folder that holds `toolchain`, its size in bytes, when it was changed (ns)."""
Compile = Callable[[CcOptions, Input, Path], bytes]
"""Makes an object of one source with a scratch folder: the driver, which itself needs this library."""


def library(compile_one: Compile, jobs: int = 0) -> bytes:
    """The archive's bytes. Builds it (seconds, once) when the cache has none for these sources and this compiler."""
    key = fingerprint()
    cached = runtime_libraries() / f"libdspic-{key}.a"
    try:
        return cached.read_bytes()
    except OSError:
        pass
    content = build(compile_one, jobs)
    if fingerprint() == key:  # nobody edited the compiler meanwhile
        _store(cached, content)
    return content


def fingerprint() -> str:
    """Hash of the library's sources, the headers, the compiler's code and the packages it runs on."""
    return _hash_of(tuple(sorted(_dependencies(str(Path(__file__).parents[2])))))


@cache
def _hash_of(dependencies: tuple[Dependency, ...]) -> str:
    """The files are read again when one has another size or time of change: a process may link many programs."""
    digest = hashlib.sha256(f"{version('ziglang')} {version('llvmlite')} {sys.version_info[:2]}".encode())
    root = Path(__file__).parents[2]
    for parts, _, _ in dependencies:
        name = "/".join(parts)
        digest.update(name.encode() + b"\0" + (root / name).read_bytes())
    return digest.hexdigest()[:20]


def _dependencies(root: str) -> Iterator[Dependency]:
    for package in PACKAGE_DIRS:
        for folder, _, names in os.walk(os.path.join(root, package)):
            place = os.path.relpath(folder, root).replace(os.sep, "/")
            for name in names:
                path = f"{place}/{name}"
                if name.endswith(SUFFIXES) and not path.startswith(UNRELATED):
                    status = os.stat(os.path.join(folder, name))
                    yield tuple(path.split("/")), status.st_size, status.st_mtime_ns


def build(compile_one: Compile, jobs: int = 0) -> bytes:
    """Compile and assemble every file of `runtime/`, one archive member each."""
    from toolchain.elf.archive import Member, archive_bytes

    sources = sorted(path for path in RUNTIME_DIR.iterdir() if path.suffix in LANGUAGES)
    with ProcessPoolExecutor(max_workers=jobs or os.cpu_count() or 1) as pool:
        made = pool.map(partial(_member, compile_one), sources)
        members = [Member(path.stem + ".o", data) for path, data in zip(sources, made, strict=True)]
    return archive_bytes(members)


def _member(compile_one: Compile, source: Path) -> bytes:
    item = Input(source, LANGUAGES[source.suffix])
    options = CcOptions(
        inputs=[item],
        stage="assemble",
        level=LEVEL,
        stack_check=True,  # a program's own checks are worth nothing if the functions it calls have none
        runtime=False,
        clang=["-std=c11" if item.language == "c" else "-std=c++17", "-ffreestanding", "-Wall"],
    )
    with tempfile.TemporaryDirectory(prefix="dspic-rt-") as scratch:
        return _weakened(compile_one(options, item, Path(scratch)), source.name)


def _weakened(content: bytes, name: str) -> bytes:
    """The object with every global definition made weak: a program may replace any library function by its own."""
    from toolchain.elf.model import Bind, Home
    from toolchain.elf.read import read_object
    from toolchain.elf.write import object_bytes

    obj = read_object(content, name)
    for symbol in obj.symbols:
        if symbol.bind is Bind.GLOBAL and symbol.home is not Home.UNDEFINED:
            symbol.bind = Bind.WEAK
    return object_bytes(obj)


def _store(path: Path, content: bytes) -> None:
    """Keep the archive for the next run; a cache folder that cannot be written only costs time."""
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=".libdspic.", dir=path.parent)
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        os.replace(temporary, path)
        for old in sorted(path.parent.glob("libdspic-*.a"), key=lambda p: p.stat().st_mtime)[:-8]:
            old.unlink(missing_ok=True)
    except OSError:
        return


def defined_names(content: bytes) -> set[str]:
    """Assembler names the library defines: a program's own versions of them must stay visible to it."""
    from toolchain.elf.archive import open_archive

    return set(open_archive(content, "run-time library").index)
