"""Files by name: `-` is standard input or output, and what is written appears whole or not at all.

A leaf: every part of the project reads and writes what a user names on a command line here.
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
from typing import Final, TextIO

STANDARD: Final = "-"
MOST_LETTERS: Final = 60
"""Of four octets each they leave room for what makes a name temporary: a name has 255."""


def is_standard(path: str | os.PathLike[str]) -> bool:
    """Whether a name means standard input or output."""
    return os.fspath(path) == STANDARD


def is_opened(path: str | os.PathLike[str]) -> bool:
    """Whether a path is a device, a pipe, or a name that the system gives to an open file (/dev/stdout): to be opened
    and written, never to be replaced by a file."""
    target = Path(path)
    of_system = os.path.abspath(target).startswith(("/dev/", "/proc/"))
    return target.exists() and (not target.is_file() or (of_system and target.is_symlink()))


def read_file(path: str | os.PathLike[str], limit: int = -1) -> bytes:
    """The octets of a file, at most `limit` of them if that is not negative. Raises OSError, and ValueError for a name
    that no file can have."""
    if is_standard(path):
        octets = _standard_input()
        return octets if limit < 0 else octets[:limit]
    with open(path, "rb") as file:
        return file.read(limit)


@cache
def _standard_input() -> bytes:
    """Once for all who ask: a command may look at its image twice."""
    return sys.stdin.buffer.read()


def write_standard(data: bytes) -> None:
    """Octets to standard output, behind what was printed. Raises OSError."""
    sys.stdout.flush()
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()


@contextmanager
def atomic_text_file(path: str | os.PathLike[str]) -> Iterator[TextIO]:
    """A text file that becomes `path` when the block ends without an exception.

    Pipes and devices are written directly, and so is standard output. Raises OSError as `open` does.
    """
    if is_standard(path):
        yield sys.stdout
        sys.stdout.flush()
        return
    if is_opened(path):
        with open(path, "w", encoding="utf-8") as stream:
            yield stream
        return
    with atomic_file(path) as part, part.open("w", encoding="utf-8") as stream:
        yield stream


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A new, empty file beside `path`, to be written by name. It becomes `path` when the block ends without an
    exception; for standard output, a pipe or a device what it holds is copied. Raises OSError as `open` does.
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
    """A new, empty file that may become `path`. Raises OSError as `open` would for `path`."""
    target = _followed(path)
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), os.fspath(path))
    try:
        return _temporary(target, target.parent)
    except OSError as error:
        raise OSError(error.errno, error.strerror, os.fspath(path)) from error


def replace_file(part: Path, path: str | os.PathLike[str]) -> None:
    """What `temporary_beside` made becomes `path`, with the permissions of the file that was there. Raises OSError."""
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
    """The file that `open` would write: symbolic links stay."""
    return Path(os.path.realpath(path))


def _temporary(path: str | os.PathLike[str], folder: Path | None = None) -> Path:
    """Begins with the name of what it becomes, as far as one name may be long."""
    handle, name = tempfile.mkstemp(dir=folder, prefix=f"{Path(path).name[:MOST_LETTERS]}.", suffix=".part")
    os.close(handle)
    return Path(name)
