"""Machine code kept between runs: one file per translated piece, named by the hash of all that went into it.

A file is a checksum followed by an object file. Several processes may share the folder: files appear by atomic
rename, and one that is short, damaged or foreign counts as absent. Objects contain no absolute address (the record
and the table of callbacks are arguments), so they can be loaded by any later process on the same kind of CPU.

The folder is bounded. Names are hashes and their first two digits a subfolder, a *shelf*: each has an equal share of
the space, and what was used least recently leaves a shelf that is full.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final

from emu.host.paths import native_code

CHECKSUM_BYTES: Final = 32
SHELVES: Final = 256
LIMIT_BYTES: Final = 128 << 20
"""Space for all objects, some 25,000 of them: they take 5 kB on average, 55 kB at most."""


@cache
def sources_hash() -> bytes:
    """Hash of every module whose text decides what is generated: table, translator, device descriptions."""
    root = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for part in ("dspic30f", "peripherals", "boards", "chips", "system"):
        for path in sorted((root / part).rglob("*.py")):
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.digest()


class ObjectCache:
    """Objects on disk by key. A folder that cannot be written only costs speed: objects are then not kept."""

    def __init__(self, where: Path | None = None, limit: int = LIMIT_BYTES) -> None:
        self.where: Final = where if where is not None else native_code()
        self.limit: Final = limit
        """Bytes that all objects together may take."""
        self.hits = 0
        self.stores = 0

    def key(self, *parts: bytes) -> str:
        """Name of the object that the given inputs lead to."""
        digest = hashlib.sha256(sources_hash())
        for part in parts:
            digest.update(len(part).to_bytes(4, "little") + part)
        return digest.hexdigest()

    def get(self, key: str) -> bytes | None:
        """The object kept under `key`, or None when there is none that is whole."""
        path = self.where / key[:2] / key
        try:
            blob = path.read_bytes()
        except OSError:
            return None
        with suppress(OSError):
            os.utime(path)
        checksum, code = blob[:CHECKSUM_BYTES], blob[CHECKSUM_BYTES:]
        if hashlib.sha256(code).digest() != checksum:
            return None
        self.hits += 1
        return code

    def put(self, key: str, code: bytes) -> None:
        """Keep `code` under `key`; readers see all of it or nothing."""
        try:
            parent = self.where / key[:2]
            parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(dir=parent)
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(code).digest() + code)
            os.replace(name, parent / key)
            self._tidy(parent, key)
        except OSError:
            return
        self.stores += 1

    def _tidy(self, shelf: Path, kept: str) -> None:
        """Let the least recently used objects leave a shelf that is over its share; others may be doing the same."""
        with os.scandir(shelf) as entries:
            found = sorted((entry.stat().st_mtime_ns, entry.stat().st_size, entry.name) for entry in entries)
        excess = sum(size for _, size, _ in found) - self.limit // SHELVES
        for _, size, name in found:
            if excess <= 0:
                return
            if name != kept:
                (shelf / name).unlink(missing_ok=True)
                excess -= size
