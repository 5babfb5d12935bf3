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
    target = Path(path)
    if is_opened(target):
        with target.open("w", encoding="utf-8") as stream:
            yield stream
        return
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=target.name + ".", suffix=".part", text=True)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            yield stream
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(name, 0o666 & ~mask)
        os.replace(name, target)
    except BaseException:
        os.unlink(name)
        raise
