"""Folders of the cache, which only their owner may write: the cache holds native code that this process loads.

The module imports nothing of the project.
"""

from __future__ import annotations

import os
import stat
import sys
from functools import cache
from pathlib import Path
from typing import Final

ROOT_USER: Final = 0


def make_private(folder: Path) -> None:
    """Create a folder and its missing parents with mode 0700. Raises OSError."""
    for one in reversed((folder, *folder.parents)):
        if not one.exists():  # `mkdir(parents=True)` would give the parents the mode of the umask
            one.mkdir(mode=0o700, exist_ok=True)


def danger(folder: Path) -> str:
    """Return why a folder must not be used as a cache: another user owns it, or can write or replace it. Empty if it is
    safe.

    A missing folder is safe: `make_private` creates it. Windows has no such modes; there every folder is safe.
    """
    try:
        status, link, parent = folder.stat(), folder.lstat(), folder.absolute().parent.stat()
    except OSError:
        return ""
    if os.name != "posix":
        return ""
    if link.st_uid not in (os.geteuid(), ROOT_USER):  # of a symbolic link, too: its owner could turn it elsewhere
        return f"it belongs to another user (uid {link.st_uid})"
    if status.st_uid != os.geteuid():
        return f"it belongs to another user (uid {status.st_uid})"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"other users can write it (mode {stat.S_IMODE(status.st_mode):04o})"
    if parent.st_mode & stat.S_IWOTH and not parent.st_mode & stat.S_ISVTX:
        return f"other users can replace it (mode {stat.S_IMODE(parent.st_mode):04o} of the folder around it)"
    return ""


def is_usable(*folders: Path) -> bool:
    """Whether no folder is dangerous. A dangerous one is reported on standard error, once per process."""
    return all(_is_usable(folder, danger(folder)) for folder in folders)


@cache
def _is_usable(folder: Path, why: str) -> bool:
    workers = sys.modules.get("multiprocessing.process")  # imported here, it would delay the start of every command
    is_worker = workers is not None and workers.parent_process() is not None
    if why and not is_worker:  # the parent of a worker has reported it
        print(f"openswarm: the cache {folder} is not used, because {why}; delete it, or set OPENSWARM_CACHE to a "
              "folder of your own with mode 0700", file=sys.stderr, flush=True)  # fmt: skip
    return not why
