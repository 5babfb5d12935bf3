"""IR of unchanged C files from the cache (-fcache-ir).

The key of an entry is the hash of the compiler, the flags, and the source file with its content. The key has the
paths of folders as they are in debug information, so checkouts and installations in several places share entries.

The entry names the headers that clang read, with their hashes. It also names the files that would be other headers of
the same name: a new file there could be the one that clang reads instead. An entry is valid while nothing of this
differs.

Not cached: sources with messages, dependency files (-MD), and sources, headers or flags whose meaning depends on the
time or on the existence of other files (`__TIME__`, `__has_include`).
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import time
import zlib
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Final

from emu.host.disk_cache import DiskCache
from emu.host.paths import front_end_results
from toolchain.driver.runtime_archive import fingerprint
from toolchain.frontend.clang import INCLUDE_DIR, ClangJob, builtin_include_dir
from toolchain.frontend.options import CcOptions, Input

LIMIT_BYTES: Final = 64 << 20
COMPRESSION: Final = 1
"""Level of zlib: the fastest."""
VARYING: Final = re.compile(rb"__(DATE|TIME|TIMESTAMP)__|__has_(include|embed)|[Pp]ragma.*\bdependency\b")
"""Words of a source or flag whose meaning depends on more than the content of files."""
LEADING_DOTS: Final = re.compile(r"^(\./+)+")
SPLICE: Final = re.compile(rb"\\\r?\n")
CLOCK_TICK: Final = 0.02
"""Maximum lag of time stamps of files behind `time.time`, in seconds."""
PREFIX_MAP: Final = re.compile(r"-f(file|debug)-prefix-map=([^=]*)=(.*)")
SEARCH_FLAGS: Final = ("-I", "-iquote", "-isystem", "-idirafter")
FORCED_INCLUDES: Final = ("-include", "-imacros")
HEADER_PATHS: Final = ("CPATH", "C_INCLUDE_PATH")
"""Environment variables with folders that clang searches for headers."""
ENVIRONMENT: Final = (*HEADER_PATHS, "SOURCE_DATE_EPOCH", "CCC_OVERRIDE_OPTIONS")
DEPENDENCY: Final = re.compile(r"(?:\\[^\n]|[^\s\\])+")
OWN_HEADERS: Final = {str(INCLUDE_DIR): "<toolchain>", str(builtin_include_dir()): "<clang>"}
"""Folders whose headers test only for each other's existence, with the names that keys and entries contain instead."""


class IrCache:
    """IR of the C files of one run of the driver. Files are read at most once for all of them."""

    def __init__(self) -> None:
        compiler = fingerprint().encode()
        self.store: Final = DiskCache(front_end_results(), LIMIT_BYTES, lambda: compiler)
        self._varies: dict[str, bool] = {}
        self._hashes: dict[str, str | None] = {}
        self._present: dict[str, bool] = {}
        self._here: Final = _working_folder()
        self._started: Final = time.time()

    def find(self, job: ClangJob) -> bytes | None:
        """Return the IR of the source of a front-end job; None if there is no valid entry."""
        entry = self.store.get(self._key(job))
        if entry is None:
            return None
        head, _, packed = entry.partition(b"\n")
        record = json.loads(_absolute(head.decode()))
        if any(self._hash(path) != digest for path, digest in record["headers"].items()):
            return None
        if self._others(record["headers"], record["folders"], record["names"]) != record["others"]:
            return None
        return zlib.decompress(packed)

    def add(self, job: ClangJob, dependencies: str, ir: bytes) -> None:
        """Store the IR of a job; `dependencies` is the rule that clang's -MD has written.

        A file that has changed since the run began is not what clang has read; then nothing is stored.
        """
        read = {_unescaped(word) for word in DEPENDENCY.findall(dependencies.partition(":")[2])} | {str(job.source)}
        headers = sorted(read - {str(job.source)})
        hashes = {path: self._hash(path) for path in headers}
        if None in hashes.values() or any(os.stat(path).st_mtime >= self._started - CLOCK_TICK for path in read):
            return
        if any(VARYING.search(os.fsencode(word)) for word in job.arguments) or any(map(self._is_varying, read)):
            return
        folders = sorted({os.path.dirname(path) or "." for path in read} | _header_folders(job))
        maps = [old for _, old, _ in _prefix_maps(job) if old not in folders and old.startswith((".", *folders))]
        named = [*headers, *(f"./{path}" for path in headers)]
        # A prefix map renames a header, and the key does not contain the new name.
        if any(path.startswith(old) for path in named for old in maps):
            return
        names = {path[len(folder) + 1 :] for folder in folders for path in headers if path.startswith(f"{folder}/")}
        names |= {os.path.basename(path) for path in headers}
        if "." in folders:
            names |= {path for path in headers if not os.path.isabs(path)}
        record = {"headers": hashes, "folders": folders, "names": sorted(names),
                  "others": self._others(headers, folders, sorted(names))}  # fmt: skip
        head = _portable(json.dumps(record))
        self.store.put(self._key(job), head.encode() + b"\n" + zlib.compress(ir, COMPRESSION))

    def _key(self, job: ClangJob) -> str:
        """Return the key of a job without the paths of its outputs."""
        *given, _, _ = job.arguments  # without -o OUTPUT
        words = [word for word in given if not PREFIX_MAP.match(word)]
        maps = _prefix_maps(job)
        named = [_mapped(path, [one for one in maps if one[0] in kinds])
                 for kinds in (("file",), ("file", "debug"))
                 for path in (self._here, str(job.source), *_search_folders(job))]  # fmt: skip
        environment = [f"{name}={os.environ.get(name)}" for name in ENVIRONMENT]
        text = _portable("\0".join([job.chip.name, *named, *environment, *words]))
        return self.store.key(text.encode(errors="surrogateescape"), _content(str(job.source)))

    def _others(self, headers: Iterable[str], folders: list[str], names: list[str]) -> list[str]:
        """Return the existing files that have the name of a header in another folder."""
        known = set(headers)
        paths = [f"{folder}/{name}" for folder in folders for name in names]
        return [path for path in paths if path not in known and self._is_present(path)]

    def _is_varying(self, path: str) -> bool:
        """Whether the meaning of a file depends on the time or on the existence of files."""
        found = self._varies.get(path)
        if found is None:
            content = b"" if path.startswith(tuple(OWN_HEADERS)) else _content(path)
            found = self._varies[path] = VARYING.search(SPLICE.sub(b"", content)) is not None
        return found

    def _is_present(self, path: str) -> bool:
        found = self._present.get(path)
        if found is None:
            found = self._present[path] = os.path.exists(path)
        return found

    def _hash(self, path: str) -> str | None:
        if path not in self._hashes:
            content = _content(path)
            self._hashes[path] = hashlib.sha256(content).hexdigest() if content or os.path.isfile(path) else None
        return self._hashes[path]


def is_cacheable(options: CcOptions, item: Input) -> bool:
    """Whether -fcache-ir concerns an input: a C file, without dependency files and printed commands."""
    return options.cache_ir and item.language == "c" and not options.dependency and not options.verbose


def dependency_flags(output: Path) -> list[str]:
    """Return the flags by which a front-end job writes the names of its headers to a file."""
    return ["-MD", "-MF", str(output), "-MT", "ir"]


def _working_folder() -> str:
    """Return the working folder as clang names it: $PWD if that is the folder."""
    named = os.environ.get("PWD", "")
    return named if os.path.isabs(named) and os.path.exists(named) and os.path.samefile(named, ".") else os.getcwd()


def _prefix_maps(job: ClangJob) -> list[tuple[str, str, str]]:
    """Return kind, old and new text of the prefix maps of a job."""
    matches = [PREFIX_MAP.match(word) for word in job.arguments]
    return [(found[1], found[2], found[3]) for found in matches if found]


def _mapped(path: str, maps: list[tuple[str, str, str]]) -> str:
    """Return a path with its prefix replaced by the last map that matches, as clang does."""
    for _, old, new in reversed(maps):
        if path.startswith(old):
            return new + path[len(old) :]
    return path


def _portable(text: str) -> str:
    """Return a text with names instead of the folders of own headers."""
    for folder, name in OWN_HEADERS.items():
        text = text.replace(folder, name)
    return text


def _absolute(text: str) -> str:
    """Return the text with the folders of own headers instead of their names, the inverse of `_portable`."""
    for folder, name in OWN_HEADERS.items():
        text = text.replace(name, folder)
    return text


def _search_folders(job: ClangJob) -> list[str]:
    """Return the folders that the job's options name for header searches."""
    words = job.arguments
    folders = [after for word, after in pairwise(words) if word in SEARCH_FLAGS]
    return folders + [word[2:] for word in words if word.startswith("-I") and len(word) > 2]


def _header_folders(job: ClangJob) -> set[str]:
    """Return the folders in which clang searches headers, without those of the including files.

    A forced include is first searched in the working folder.
    """
    folders = _search_folders(job)
    folders += [one for name in HEADER_PATHS if (paths := os.environ.get(name)) for one in paths.split(os.pathsep)]
    if any(word in FORCED_INCLUDES and not os.path.isabs(after) for word, after in pairwise(job.arguments)):
        folders.append(".")
    return {_dependency_name(folder) for folder in folders}


def _dependency_name(folder: str) -> str:
    """Return the folder of a header as dependency files write it: without a leading `./` and slashes at the end."""
    return LEADING_DOTS.sub("", folder + "/").rstrip("/") or ("/" if folder.startswith("/") else ".")


def _unescaped(word: str) -> str:
    """Return a path of a dependency file as it is on disk."""
    return re.sub(r"\\([\s#\\])", r"\1", word).replace("$$", "$")


def _content(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError:
        return b""
