"""Keyed checksums of the files in a cache folder.

Each folder has a random key in a file that only its owner can read. A checksum covers the key, the name of a file and
its content, so damaged files, files of other caches and files under another name count as absent. So do all files
beside a key that is missing, damaged, no regular file, or of a mode or an owner that lets other users know it.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
import stat
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
    """Return the folder's key, empty if it has none that is secret."""
    path = folder / KEY_FILE
    try:
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode) or not _is_secret(status):
            return b""
        return _read(path, status.st_ino, status.st_mtime_ns)
    except OSError:
        return b""


def _is_secret(status: os.stat_result) -> bool:
    """Whether only this user can read and write a file; Windows has no such modes."""
    return os.name != "posix" or (status.st_uid == os.geteuid() and not stat.S_IMODE(status.st_mode) & 0o077)


@cache
def _read(path: Path, _inode: int, _modified: int) -> bytes:
    """Return the key in a file; empty if it has another length, or zeros only, as after a crash of the file system.

    Read once per version of the file. Raises OSError.
    """
    with path.open("rb") as file:
        found = file.read(KEY_BYTES + 1)
    return found if len(found) == KEY_BYTES and any(found) else b""


def _new_key(folder: Path) -> bytes:
    """Store a new key and return it, or the key that another process has stored meanwhile."""
    handle, name = tempfile.mkstemp(dir=folder)  # with mode 0600
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(secrets.token_bytes(KEY_BYTES))
        if os.path.lexists(folder / KEY_FILE) and not _key(folder):
            (folder / KEY_FILE).unlink()  # a damaged key
        with suppress(FileExistsError):
            os.link(name, folder / KEY_FILE)
    finally:
        os.unlink(name)
    return _key(folder)
