"""Where things lie on this machine that belong to no project: the user's cache, and what comes along as files.

A leaf: it imports nothing of ours, and every part of the project asks here. Nothing is created by asking.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

_ROOT: Final = Path(__file__).resolve().parents[2]
"""The checkout, or the folder of installed packages."""


def cache() -> Path:
    """The folder of everything that can be made again: `$OPENSWARM_CACHE`, else `openswarm` in the user's cache folder
    (`$XDG_CACHE_HOME` or `~/.cache`; on macOS and Windows what is usual there)."""
    own = os.environ.get("OPENSWARM_CACHE")
    if own:
        return Path(own)
    from platformdirs import user_cache_path

    return user_cache_path("openswarm", appauthor=False)


def use_cache(folder: str) -> Path:
    """Keep everything below another folder from now on, in this process and those it starts: `--cache DIR`."""
    os.environ["OPENSWARM_CACHE"] = os.path.abspath(folder)
    return cache()


def native_code() -> Path:
    """Machine code that the emulator's compiler has made of firmware; at most 128 MB."""
    return cache() / "jit"


def runtime_libraries() -> Path:
    """The C library for the robot, one archive per version of the compiler; at most eight."""
    return cache() / "toolchain"


def images() -> Path:
    """Applications of `firmware/apps` that `arena run` has built from an installed package."""
    return cache() / "firmware"


def history() -> Path:
    """What was typed at the debugger's prompt, in the user's folder for such things (`$XDG_STATE_HOME`)."""
    from platformdirs import user_state_path

    return user_state_path("openswarm", appauthor=False) / "debug-history"


def in_checkout() -> bool:
    """Whether this code runs in the project's own folder and not from an installed package."""
    return (_ROOT / "firmware" / "Makefile").is_file()


def firmware() -> Path:
    """The folder with the kernel's Makefile: the checkout's, or the copy that comes with the package."""
    return _ROOT / "firmware" if in_checkout() else _ROOT / "openswarm" / "firmware"


def cmake() -> Path:
    """The folder with CMake's toolchain file `openswarm.cmake`."""
    return _ROOT / "openswarm" / "cmake"
