"""Disk cache of native code: one object file per translation, named by the hash of all inputs of the translation.

Objects contain no absolute addresses, because the record and the environment are arguments, so any later process on
the same kind of CPU can load them.
"""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path
from typing import Final

from emu.host.disk_cache import DiskCache
from emu.host.paths import native_code

LIMIT_BYTES: Final = 128 << 20
"""Maximum total size in bytes: about 60,000 objects, compressed to 2 kB on average."""


@cache
def sources_hash() -> bytes:
    """Return the hash of all modules that determine the generated code: instruction table, translator, devices."""
    root = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for part in ("dspic30f", "peripherals", "boards", "chips", "system"):
        for path in sorted((root / part).rglob("*.py")):
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.digest()


class ObjectCache(DiskCache):
    """Cache of native code in the user's cache folder or in `where`. Objects are code that this process executes."""

    def __init__(self, where: Path | None = None, limit: int = LIMIT_BYTES) -> None:
        super().__init__(where if where is not None else native_code(), limit, sources_hash)
