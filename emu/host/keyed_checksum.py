"""Keyed checksums of the files in a cache folder.

Each folder has a random key in a file that only its owner can read. A checksum covers the key, the name of a file and
its content, so damaged files, files of other caches and files under another name count as absent.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final

KEY_FILE: Final = "key"
KEY_BYTES: Final = 32
CHECKSUM_BYTES: Final = 32


def with_checksum(folder: Path, name: str, content: bytes) -> bytes:
    """Return `content` behind its checksum, for the file `name` of `folder`. Raises OSError if no key can be stored."""
    key = _key(folder) or _new_key(folder)
    if not key:
        raise OSError(f"{folder / KEY_FILE}: expected {KEY_BYTES} bytes")
    return _checksum(key, name, content) + content


def content_of(folder: Path, name: str, blob: bytes) -> bytes | None:
    """Return the content of a file that `with_checksum` made; None if the checksum is wrong or the key is missing."""
    key = _key(folder)
    checksum, content = blob[:CHECKSUM_BYTES], blob[CHECKSUM_BYTES:]
    return content if key and hmac.compare_digest(_checksum(key, name, content), checksum) else None


def _checksum(key: bytes, name: str, content: bytes) -> bytes:
    digest = hashlib.blake2b(name.encode() + b"\0", key=key, digest_size=CHECKSUM_BYTES)
    digest.update(content)
    return digest.digest()


def _key(folder: Path) -> bytes:
    """Return the folder's key, empty if it has none."""
    path = folder / KEY_FILE
    try:
        status = path.stat()
    except OSError:
        return b""
    return _read(path, status.st_ino, status.st_mtime_ns)


@cache
def _read(path: Path, _inode: int, _modified: int) -> bytes:
    """Return the key in a file; empty if it has another length. Read once per version of the file."""
    found = path.read_bytes()
    return found if len(found) == KEY_BYTES else b""


def _new_key(folder: Path) -> bytes:
    """Store a new key and return it, or the key that another process has stored meanwhile."""
    handle, name = tempfile.mkstemp(dir=folder)  # with mode 0600
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(secrets.token_bytes(KEY_BYTES))
        if (folder / KEY_FILE).exists() and not _key(folder):
            (folder / KEY_FILE).unlink()  # a damaged key
        with suppress(FileExistsError):
            os.link(name, folder / KEY_FILE)
    finally:
        os.unlink(name)
    return _key(folder)
