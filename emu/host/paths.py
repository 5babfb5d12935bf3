"""Paths of the user's cache and of the files installed with the package.

The module imports nothing of the project. Its functions create no files or folders.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

_ROOT: Final = Path(__file__).resolve().parents[2]
"""The checkout's folder, or the folder of installed packages."""


def cache() -> Path:
    """Return the cache folder: `$OPENSWARM_CACHE`, else `openswarm` in the user's cache folder.

    The user's cache folder is `$XDG_CACHE_HOME` or `~/.cache`; on macOS and Windows it is the platform's standard
    folder. Users without a home folder, as in containers, have a folder below the one for temporary files.
    """
    own = os.environ.get("OPENSWARM_CACHE")
    if own:
        return Path(own)
    from platformdirs import user_cache_path

    return _or_temporary(user_cache_path)


def use_cache(folder: str) -> Path:
    """Set the cache folder for this process and its children, as `--cache DIR` does."""
    os.environ["OPENSWARM_CACHE"] = os.path.abspath(folder)
    return cache()


def native_code() -> Path:
    """Return the cache folder of native code compiled from firmware, which is at most 128 MB large."""
    return cache() / "jit"


def runtime_libraries() -> Path:
    """Return the cache folder of the target's C library. It holds one archive per compiler version, at most eight."""
    return cache() / "toolchain"


def headers() -> Path:
    """Return the cache folder of generated device headers. It has one folder per version of the chips' tables."""
    return cache() / "headers"


def front_end_results() -> Path:
    """Return the cache folder of the IR of C files (`toolchain cc -fcache-ir`), which is at most 64 MB large."""
    return cache() / "ir"


def images() -> Path:
    """Return the cache folder of the `firmware/apps` images that `arena run` builds for an installed package."""
    return cache() / "firmware"


def history() -> Path:
    """Return the history file of the debugger prompt, in the user's state folder (`$XDG_STATE_HOME`)."""
    from platformdirs import user_state_path

    return _or_temporary(user_state_path) / "debug-history"


def _or_temporary(user_folder: Callable[..., Path]) -> Path:
    """Return the project's folder in a folder of the user, or one for temporary files if the user has no home.

    Without HOME and an entry in the user database, some versions of platformdirs do not expand `~`, others raise."""
    with contextlib.suppress(RuntimeError):
        folder = user_folder("openswarm", appauthor=False)
        if folder.is_absolute():
            return folder
    return Path(tempfile.gettempdir()) / f"openswarm-{os.getuid()}"


def in_checkout() -> bool:
    """Whether this code runs from a checkout, not from an installed package."""
    return (_ROOT / "firmware" / "Makefile").is_file()


def firmware() -> Path:
    """Return the folder with the kernel's Makefile: the checkout's, or the copy installed with the package."""
    return _ROOT / "firmware" if in_checkout() else _ROOT / "openswarm" / "firmware"


def cmake() -> Path:
    """Return the folder with the CMake toolchain file `openswarm.cmake`."""
    return _ROOT / "openswarm" / "cmake"
