"""Cache folders on disk: one file per object, named by the hash of all inputs that determine its content.

A file is a keyed checksum followed by the content. Several processes may share the folder. A file appears by an atomic
rename; a short, damaged or foreign file counts as absent.

The size of the folder is limited. The first two digits of a name are a subfolder, called shelf, and all shelves have
equal shares of the space. A shelf that exceeds its share evicts its least recently used objects.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

from emu.host.keyed_checksum import content_of, with_checksum
from emu.host.private_folder import is_usable, make_private

SHELVES: Final = 256


class DiskCache:
    """Objects below the folder `where`, at most `limit` bytes in total. `salt` returns a part of every key.

    If the folder cannot be written, objects are not stored. A folder that another user owns or can write is not used.
    """

    def __init__(self, where: Path, limit: int, salt: Callable[[], bytes]) -> None:
        self.where: Final = where
        self.limit: Final = limit
        """Maximum total size of all objects in bytes."""
        self.salt: Final = salt
        self.hits = 0
        self.stores = 0

    def key(self, *parts: bytes) -> str:
        """Return the cache key of the object that is made from these inputs."""
        digest = hashlib.sha256(self.salt())
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
        content = content_of(self.where, key, blob)
        self.hits += content is not None
        return content

    def put(self, key: str, content: bytes) -> None:
        """Store `content` under `key`. Readers see either the complete file or none."""
        try:
            parent = self.where / key[:2]
            make_private(parent)
            if not is_usable(self.where.parent, self.where, parent):
                return
            blob = with_checksum(self.where, key, content)
            handle, name = tempfile.mkstemp(dir=parent)
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(blob)
                os.replace(name, parent / key)
            except OSError:
                os.unlink(name)  # half a file on a full disk
                raise
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
