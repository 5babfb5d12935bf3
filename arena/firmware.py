"""Which image a brain is: builds the project's own applications, takes any file."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Final

import emu

ROOT: Final = Path(__file__).resolve().parent.parent / "firmware"
APPLICATIONS: Final = {"openswarm": "clustering", "bare": "clustering-bare"}


def image_for(brain: str) -> Path | None:
    """The image of a brain, built if it is one of ours; None for `scripted`. Raises LoadError for a file that is no
    image, ValueError for a name that is none or firmware that cannot be built."""
    if brain == "scripted":
        return None
    if brain not in APPLICATIONS:
        path = Path(brain)
        if not path.exists():
            known = ", ".join(("scripted", *APPLICATIONS))
            raise ValueError(f"--brain {brain}: no such file, and none of {known}")
        emu.load(path)  # says at once what is wrong with it
        return path
    application = APPLICATIONS[brain]
    if not (ROOT / "apps" / application).is_dir():
        raise ValueError(f"--brain {brain}: there is no firmware/apps/{application} beside this package")
    command = ["make", "-C", str(ROOT), f"APP={application}", f"PYTHON={sys.executable}"]
    try:
        built = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise ValueError(f"--brain {brain}: make cannot be run: {error}") from None
    if built.returncode:
        raise ValueError(f"--brain {brain}: {' '.join(command)} failed:\n{built.stderr.strip()}")
    return ROOT / "build" / application / "firmware.elf"
