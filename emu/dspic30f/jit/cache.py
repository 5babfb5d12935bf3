"""Disk cache of native code: one file per object, named by the hash of all inputs of the translation.

A file is a checksum followed by an object file. Several processes may share the folder. A file appears by an atomic
rename; a short, damaged or foreign file counts as absent. Objects contain no absolute addresses, because the record and
the environment are arguments, so any later process on the same kind of CPU can load them.

The size of the folder is limited. The first two digits of a name are a subfolder, called shelf, and all shelves have
equal shares of the space. A shelf that exceeds its share evicts its least recently used objects.
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
from emu.host.private_folder import is_usable, make_private

CHECKSUM_BYTES: Final = 32
SHELVES: Final = 256
LIMIT_BYTES: Final = 128 << 20
"""Maximum total size in bytes: about 25,000 objects, of 5 kB on average and at most 55 kB each."""


@cache
def sources_hash() -> bytes:
    """Return the hash of all modules that determine the generated code: instruction table, translator, devices."""
    root = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for part in ("dspic30f", "peripherals", "boards", "chips", "system"):
        for path in sorted((root / part).rglob("*.py")):
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.digest()


class ObjectCache:
    """Cache of objects on disk. If the folder cannot be written, objects are not stored.

    A folder that another user owns or can write is not used at all: an object is code that this process executes."""

    def __init__(self, where: Path | None = None, limit: int = LIMIT_BYTES) -> None:
        self.where: Final = where if where is not None else native_code()
        self.limit: Final = limit
        """Maximum total size of all objects in bytes."""
        self.hits = 0
        self.stores = 0

    def key(self, *parts: bytes) -> str:
        """Return the cache key of the object that is translated from these inputs."""
        digest = hashlib.sha256(sources_hash())
        for part in parts:
            digest.update(len(part).to_bytes(4, "little") + part)
        return digest.hexdigest()

    def get(self, key: str) -> bytes | None:
        """Return the object stored under `key`, None if it is absent or its checksum is wrong."""
        path = self.where / key[:2] / key
        if not is_usable(self.where.parent, self.where, path.parent):
            return None
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
        """Store `code` under `key`. Readers see either the complete file or none."""
        try:
            parent = self.where / key[:2]
            make_private(parent)
            if not is_usable(self.where.parent, self.where, parent):
                return
            handle, name = tempfile.mkstemp(dir=parent)
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(code).digest() + code)
            os.replace(name, parent / key)
            self._evict(parent, key)
        except OSError:
            return
        self.stores += 1

    def _evict(self, shelf: Path, new: str) -> None:
        """Evict the least recently used objects, except `new`, of a shelf that exceeds its share.

        Other processes may do so at the same time.
        """
        with os.scandir(shelf) as entries:
            found = sorted((entry.stat().st_mtime_ns, entry.stat().st_size, entry.name) for entry in entries)
        excess = sum(size for _, size, _ in found) - self.limit // SHELVES
        for _, size, name in found:
            if excess <= 0:
                return
            if name != new:
                (shelf / name).unlink(missing_ok=True)
                excess -= size
