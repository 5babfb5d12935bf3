"""Source files by their names in an image's debug information, in checkouts, projects and installed packages.

Images name their sources relative to a folder, so that their bytes do not depend on the place of a checkout:
`src/main.c` to that of the project, `firmware/openswarm/kernel/event.c` to that of the kernel.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import Final

from emu.host import paths

MAX_SOURCE_OCTETS: Final = 1 << 24
"""Largest source file that is shown, in octets."""


class SourceFinder:
    """Finds the source files of the image at `image_path`.

    Searches `roots` (the current folder if there are none), the folders above the image, and those of the kernel.
    """

    def __init__(self, image_path: str, *roots: str | Path) -> None:
        firmware = paths.firmware()
        first = [Path(root).resolve() for root in roots or (".",)]
        self.root: Final = first[0]
        self._folders: Final = (*first, *Path(image_path).resolve().parents, firmware.parent, firmware)
        self._known: Final[dict[str, Path | None]] = {}

    def find(self, name: str) -> Path | None:
        """Return the path of a source file; None if it does not exist."""
        if name not in self._known:
            places = (folder / name for folder in self._folders)
            self._known[name] = next((place.resolve() for place in places if place.is_file()), None)
        return self._known[name]

    def path(self, name: str) -> Path:
        """Return the path of a source file; below the root if it does not exist."""
        return self.find(name) or self.root / name


def source_lines(path: str | os.PathLike[str]) -> list[str]:
    """Return the lines of a source file that debug information names, as UTF-8 with replacements.

    Raises OSError if it is no regular file or has more than MAX_SOURCE_OCTETS octets: a damaged or hostile image may
    name a device or a pipe.
    """
    opened = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    with os.fdopen(opened, "rb") as file:
        if not stat.S_ISREG(os.fstat(opened).st_mode):
            raise OSError(errno.EINVAL, "is no regular file", os.fspath(path))
        data = file.read(MAX_SOURCE_OCTETS + 1)
    if len(data) > MAX_SOURCE_OCTETS:
        raise OSError(errno.EFBIG, f"is larger than {MAX_SOURCE_OCTETS >> 20} MiB", os.fspath(path))
    return data.decode("utf-8", "replace").splitlines()
