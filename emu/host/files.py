"""File access by name. `-` is standard input or output; files are written atomically.

All commands of the project use this module to read and write the files named on their command lines.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import BinaryIO, Final, TextIO

STANDARD: Final = "-"
MAX_OCTETS: Final = 1 << 28
"""Largest input that is read whole, in octets."""
PIECE_OCTETS: Final = 1 << 20
MAX_NAME_CHARACTERS: Final = 60
"""Number of characters of a name used in a temporary name; at four octets each they fit the limit of 255 octets."""


def is_standard(path: str | os.PathLike[str]) -> bool:
    """Whether a name denotes standard input or output."""
    return os.fspath(path) == STANDARD


def is_opened(path: str | os.PathLike[str]) -> bool:
    """Whether a path is a device, a pipe, or a system name of an open file (/dev/stdout).

    Such a path is written directly, never replaced by a file.
    """
    target = Path(path)
    of_system = os.path.abspath(target).startswith(("/dev/", "/proc/"))
    return target.exists() and (not target.is_file() or (of_system and target.is_symlink()))


def read_file(path: str | os.PathLike[str], limit: int = -1) -> bytes:
    """Read a file, at most `limit` octets if that is not negative.

    Raises OSError, also for more than MAX_OCTETS octets (a device may be endless), and ValueError for an invalid name.
    """
    if is_standard(path):
        octets = _standard_input()
        return octets if limit < 0 else octets[:limit]
    with open(path, "rb") as file:
        return _contents(file, os.fspath(path)) if limit < 0 else file.read(limit)


def _contents(stream: BinaryIO, name: str) -> bytes:
    """Read a stream to its end, in pieces. Raises OSError for more than MAX_OCTETS octets."""
    pieces, count = [], 0
    while piece := stream.read(PIECE_OCTETS):
        count += len(piece)
        if count > MAX_OCTETS:
            raise OSError(errno.EFBIG, f"is larger than {MAX_OCTETS >> 20} MiB", name)
        pieces.append(piece)
    return b"".join(pieces)


@cache
def _standard_input() -> bytes:
    """Return the contents of standard input, which is read only once: a command may read its image twice."""
    return _contents(sys.stdin.buffer, STANDARD)


def write_standard(data: bytes) -> None:
    """Write octets to standard output, after flushing printed text. Raises OSError."""
    sys.stdout.flush()
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()


@contextmanager
def atomic_text_file(path: str | os.PathLike[str]) -> Iterator[TextIO]:
    """Open a text file that replaces `path` when the block ends without an exception.

    Pipes, devices and standard output are written directly. Raises OSError as `open` does; its `filename` is `path`
    also for a full disk.
    """
    if is_standard(path):
        yield sys.stdout
        sys.stdout.flush()
        return
    try:
        if is_opened(path):
            with open(path, "w", encoding="utf-8") as stream:
                yield stream
        else:
            with atomic_file(path) as part, part.open("w", encoding="utf-8") as stream:
                yield stream
    except OSError as error:
        if error.filename is None and error.errno in (errno.ENOSPC, errno.EFBIG):  # errors of `write` name no file
            error.filename = os.fspath(path)
        raise


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Create an empty file beside `path` that replaces it when the block ends without an exception.

    For standard output, a pipe or a device, the content is copied to it instead. Raises OSError as `open` does.
    """
    copied = is_standard(path) or is_opened(path)
    part = _temporary(path) if copied else temporary_beside(path)
    try:
        yield part
        if is_standard(path):
            write_standard(part.read_bytes())
        elif copied:
            Path(path).write_bytes(part.read_bytes())
        else:
            replace_file(part, path)
    finally:
        part.unlink(missing_ok=True)


def temporary_beside(path: str | os.PathLike[str]) -> Path:
    """Create an empty file beside `path`, for `replace_file`. Raises OSError as `open` would for `path`."""
    target = _followed(path)
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), os.fspath(path))
    try:
        return _temporary(target, target.parent)
    except OSError as error:
        raise OSError(error.errno, error.strerror, os.fspath(path)) from error


def replace_file(part: Path, path: str | os.PathLike[str]) -> None:
    """Replace `path` by a file from `temporary_beside` and keep an existing file's permissions. Raises OSError."""
    target = _followed(path)
    try:
        mode = stat.S_IMODE(target.stat().st_mode)
    except FileNotFoundError:
        mask = os.umask(0)
        os.umask(mask)
        mode = 0o666 & ~mask
    part.chmod(mode)
    part.replace(target)


def _followed(path: str | os.PathLike[str]) -> Path:
    """Return the path that `open` would write, that is, with symbolic links resolved."""
    return Path(os.path.realpath(path))


def _temporary(path: str | os.PathLike[str], folder: Path | None = None) -> Path:
    """Create a temporary file whose name begins with that of `path`, shortened to a valid length."""
    handle, name = tempfile.mkstemp(dir=folder, prefix=f"{Path(path).name[:MAX_NAME_CHARACTERS]}.", suffix=".part")
    os.close(handle)
    return Path(name)
