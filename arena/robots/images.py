"""Which image a brain is: builds the project's own applications, takes any file."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Final

import emu
from emu.host import paths

APPLICATIONS: Final = {"openswarm": "clustering", "bare": "clustering-bare"}


def image_for(brain: str, home: Path = Path()) -> Path | None:
    """The image of a brain, built if it is one of ours, or the file at a path from `home` on; None for `scripted`.
    Raises LoadError for a file that is no image, ValueError for a name that is none or what cannot be built."""
    if brain == "scripted":
        return None
    application = APPLICATIONS.get(brain, brain)
    is_own = re.fullmatch("[a-z0-9-]+", application) and (paths.firmware() / "apps" / application).is_dir()
    if brain not in APPLICATIONS and not is_own:
        path = home / brain
        if not path.exists():
            known = ", ".join(("scripted", *APPLICATIONS, "an application of firmware/apps"))
            raise ValueError(f"--brain {brain}: no such file, and none of {known}")
        emu.load(path)  # says at once what is wrong with it
        return path
    if not is_own:
        raise ValueError(f"--brain {brain}: there is no firmware/apps/{application} beside this package")
    folder = paths.firmware()
    # a package that was installed may belong to another user or to many: what is built goes into the user's cache
    out = folder / "build" / application if paths.in_checkout() else paths.images() / application
    command = ["make", "-C", str(folder), f"APP={application}", f"OUT={out}", f"PYTHON={sys.executable}"]
    try:
        built = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise ValueError(f"--brain {brain}: make cannot be run: {error}") from None
    if built.returncode:
        raise ValueError(f"--brain {brain}: {' '.join(command)} failed:\n{built.stderr.strip()}")
    return out / "firmware.elf"
