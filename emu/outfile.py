"""Output files that appear whole or not at all; `-` is standard output."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO


def is_opened(path: str | os.PathLike[str]) -> bool:
    """Whether a path is a device, a pipe, or a name that the system gives to an open file (/dev/stdout): to be opened
    and written, never to be replaced by a file."""
    target = Path(path)
    of_system = os.path.abspath(target).startswith(("/dev/", "/proc/"))
    return target.exists() and (not target.is_file() or (of_system and target.is_symlink()))


@contextmanager
def whole_text_file(path: str | os.PathLike[str]) -> Iterator[TextIO]:
    """A text file written beside `path` and renamed to it when the block ends without an exception.

    Pipes and devices are written directly, and so is standard output, which `-` means. Raises OSError as `open` does.
    """
    if path == "-":
        yield sys.stdout
        sys.stdout.flush()
        return
    if is_opened(path):
        with open(path, "w", encoding="utf-8") as stream:
            yield stream
        return
    with whole_file(path) as part, part.open("w", encoding="utf-8") as stream:
        yield stream


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A new, empty file beside `path`, to be written by name. It becomes `path` when the block ends without an
    exception; for a pipe or device what it holds is copied. Raises OSError as `open` does.
    """
    target = Path(path)
    opened = is_opened(target)
    folder = None if opened else target.parent
    handle, name = tempfile.mkstemp(dir=folder, prefix=f".{target.name}.", suffix=".part")
    os.close(handle)
    part = Path(name)
    try:
        yield part
        if opened:
            target.write_bytes(part.read_bytes())
            return
        mask = os.umask(0)
        os.umask(mask)
        part.chmod(0o666 & ~mask)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)
