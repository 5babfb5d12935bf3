"""The run-time library as an archive, built from `runtime/` on first use and cached in the user's cache folder.

The name of the cached file is a hash of all dependencies of the archive. The file is created by a rename, so concurrent
builds are safe. It is a keyed checksum followed by the archive; a damaged file counts as absent.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path

from emu.host.keyed_checksum import content_of, with_checksum
from emu.host.paths import runtime_libraries
from emu.host.private_folder import is_usable, make_private
from toolchain.frontend.options import CcOptions, Input

RUNTIME_DIR = Path(__file__).parents[1] / "runtime"
PACKAGE_DIRS = ("toolchain", "emu/dspic30f/isa", "emu/chips")
"""Dependencies of the compiled library, relative to the parent folder of `toolchain`."""
UNRELATED = (
    "toolchain/link", "toolchain/bounds", "toolchain/proof", "toolchain/commands", "toolchain/cli.py",
    "toolchain/README.md",
)  # fmt: skip
SUFFIXES = (".py", ".c", ".cpp", ".h", ".s", ".inc", ".csv")
LEVEL = "s"
SHORT_DOUBLE_VARIANTS = ("format.s", "scan.c", "scan_stream.c")
"""Sources with a variant for programs whose double has 32 bits."""
LANGUAGES = {".c": "c", ".cpp": "c++", ".s": "assembler"}


Dependency = tuple[tuple[str, ...], int, int]
"""Parts of a file's path below the parent folder of `toolchain`, size in bytes, time of modification (ns)."""
Compile = Callable[[CcOptions, Input, Path], bytes]
"""Function that compiles one source with a scratch folder; a parameter, because the driver imports this module."""


def library(compile_one: Compile, jobs: int = 0) -> bytes:
    """The archive; it is built, which takes seconds, if the cache has none for these sources and this compiler."""
    key = fingerprint()
    cached = runtime_libraries() / f"libdspic-{key}.a"
    stored = _stored(cached)
    if stored is not None:
        return stored
    content = build(compile_one, jobs)
    if fingerprint() == key:  # the compiler's sources have not changed during the build
        _store(cached, content)
    return content


def fingerprint() -> str:
    """Hash of the sources of the library, the headers, the compiler and the versions of its packages."""
    return _hash_of(tuple(sorted(_dependencies(str(Path(__file__).parents[2])))))


@cache
def _hash_of(dependencies: tuple[Dependency, ...]) -> str:
    """Hash of the content of files; cached for equal sizes and times of modification, as a process may link often."""
    packages = f"{_installed('ziglang')} {_installed('llvmlite')}"
    digest = hashlib.sha256(f"{packages} {sys.version_info[:2]}".encode())
    root = Path(__file__).parents[2]
    for parts, _, _ in dependencies:
        name = "/".join(parts)
        digest.update(name.encode() + b"\0" + (root / name).read_bytes())
    return digest.hexdigest()[:20]


def _installed(package: str) -> str:
    """Name and version of an installed package, from the name of its metadata folder.

    The import of importlib.metadata takes as long as a short run.
    """
    spec = find_spec(package)
    site = Path(spec.origin).parents[1] if spec is not None and spec.origin is not None else None
    folders = sorted(path.name for path in site.glob(f"{package}-*.dist-info")) if site is not None else []
    if folders:
        return " ".join(folders)
    from importlib.metadata import version

    return version(package)


def _dependencies(root: str) -> Iterator[Dependency]:
    """All files that the library depends on."""
    for package in PACKAGE_DIRS:
        for folder, _, names in os.walk(os.path.join(root, package)):
            relative = os.path.relpath(folder, root).replace(os.sep, "/")
            for name in names:
                path = f"{relative}/{name}"
                if name.endswith(SUFFIXES) and not path.startswith(UNRELATED):
                    status = os.stat(os.path.join(folder, name))
                    yield tuple(path.split("/")), status.st_size, status.st_mtime_ns


def build(compile_one: Compile, jobs: int = 0) -> bytes:
    """Compile and assemble every file of `runtime/` into an archive."""
    from toolchain.elf.archive import ArchiveMember, archive_bytes

    sources = sorted(path for path in RUNTIME_DIR.iterdir() if path.suffix in LANGUAGES)
    with ProcessPoolExecutor(max_workers=jobs or os.cpu_count() or 1) as pool:
        made = pool.map(partial(_member, compile_one), sources)
        members = [ArchiveMember(path.stem + ".o", data) for path, data in zip(sources, made, strict=True)]
    return archive_bytes(members)


def short_double_library(archive: bytes, compile_one: Compile) -> bytes:
    """The library for programs whose double has 32 bits: its printf and scanf take and store such doubles."""
    from toolchain.elf.archive import ArchiveMember, archive_bytes, read_members

    key = hashlib.sha256(archive).hexdigest()[:20]
    cached = runtime_libraries() / f"libdspic-short-{key}.a"
    stored = _stored(cached)
    if stored is not None:
        return stored
    sources = {Path(name).stem + ".o": RUNTIME_DIR / name for name in SHORT_DOUBLE_VARIANTS}
    members = [ArchiveMember(m.name, _member(compile_one, sources[m.name], True)) if m.name in sources else m
               for m in read_members(archive, "run-time library")]  # fmt: skip
    content = archive_bytes(members)
    _store(cached, content)
    return content


def _member(compile_one: Compile, source: Path, short_double: bool = False) -> bytes:
    item = Input(source, LANGUAGES[source.suffix])
    options = CcOptions(
        asm_define=["SHORT_DOUBLE=1"] if short_double else [],
        inputs=[item],
        stage="assemble",
        level=LEVEL,
        stack_check=True,  # a program built with -fstack-check needs library functions that check the stack limit
        runtime=False,
        clang=[
            "-std=c11" if item.language == "c" else "-std=c++17",
            "-ffreestanding",
            "-Wall",
            *(["-DSHORT_DOUBLE=1"] if short_double else []),
        ],
    )
    with tempfile.TemporaryDirectory(prefix="dspic-rt-") as scratch:
        return _weakened(compile_one(options, item, Path(scratch)), source.name)


def _weakened(content: bytes, name: str) -> bytes:
    """The object with weak global definitions, so that a program may replace any library function."""
    from toolchain.elf.model import Bind, Home
    from toolchain.elf.read import read_object
    from toolchain.elf.write import object_bytes

    obj = read_object(content, name)
    for symbol in obj.symbols:
        if symbol.bind is Bind.GLOBAL and symbol.home is not Home.UNDEFINED:
            symbol.bind = Bind.WEAK
    return object_bytes(obj)


def _stored(path: Path) -> bytes | None:
    """Return the archive of a cached file; None if it is missing, damaged, or in a folder that others can write."""
    try:
        blob = path.read_bytes() if is_usable(path.parent.parent, path.parent) else b""
    except OSError:
        return None
    return content_of(path.parent, path.name, blob)


def _store(path: Path, content: bytes) -> None:
    """Store the archive in the cache; errors are ignored, as the next run can build it again."""
    try:
        make_private(path.parent)
        if not is_usable(path.parent.parent, path.parent):
            return
        blob = with_checksum(path.parent, path.name, content)
        handle, temporary = tempfile.mkstemp(prefix=".libdspic.", dir=path.parent)
        with os.fdopen(handle, "wb") as stream:
            stream.write(blob)
        os.replace(temporary, path)
        for old in sorted(path.parent.glob("libdspic-*.a"), key=lambda p: p.stat().st_mtime)[:-8]:
            old.unlink(missing_ok=True)
    except OSError:
        return


def defined_names(content: bytes) -> set[str]:
    """Assembler names that the library defines."""
    from toolchain.elf.archive import open_archive

    return set(open_archive(content, "run-time library").index)
