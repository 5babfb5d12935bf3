"""Find the image of a `--brain`: build an application of the project, or take the file."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Final

import emu
from arena.scene.robot_kind import EPUCK, KILOBOT
from emu.avr.image import load_avr_image
from emu.host import paths
from emu.host.private_folder import danger, make_private

APPLICATIONS: Final = {"openswarm": "clustering", "bare": "clustering-bare"}
"""Applications of firmware/apps by the brain names that differ from theirs."""


def image_for(brain: str, home: Path = Path(), kind: str = EPUCK.name) -> Path | None:
    """Return the image of a brain: an application of the project, which is built, or a file, relative to `home`.

    Returns None for `scripted`. Raises LoadError if the file is not an image for this kind of robot, ValueError for an
    unknown name or a failed build.
    """
    if kind == KILOBOT.name:
        return _kilobot_image(brain, home)
    if brain == "scripted":
        return None
    application = APPLICATIONS.get(brain, brain)
    is_own = re.fullmatch("[a-z0-9-]+", application) and (paths.firmware() / "apps" / application).is_dir()
    if brain not in APPLICATIONS and not is_own:
        path = home / brain
        if not path.exists():
            known = ", ".join(("scripted", *APPLICATIONS, "an application of firmware/apps"))
            raise ValueError(f"--brain {brain}: no such file; expected a file or one of {known}")
        emu.load(path)  # report an unusable image before the run begins
        return path
    if not is_own:
        raise ValueError(f"--brain {brain}: there is no firmware/apps/{application} beside this package")
    out = _output_folder(paths.firmware(), application)
    image = out / "firmware.elf"
    _make(brain, image, paths.firmware(), f"APP={application}", f"OUT={out}", f"PYTHON={sys.executable}")
    return image


def _kilobot_image(brain: str, home: Path) -> Path:
    """Return the image of a Kilobot: a program of firmware/kilobot, which avr-gcc builds, or a file."""
    folder = paths.firmware() / "kilobot"
    if not re.fullmatch("[a-z0-9-]+", brain) or not (folder / "programs" / f"{brain}.c").is_file():
        path = home / brain
        if not path.exists():
            known = ", ".join(sorted(one.stem for one in (folder / "programs").glob("*.c")))
            raise ValueError(f"image {brain}: no such file; expected an ELF or HEX file for AVR, or one of {known}")
        load_avr_image(str(path))
        return path
    out = _output_folder(folder, "")
    image = out / f"{brain}.elf"
    _make(brain, image, folder, f"PROGRAM={brain}", f"OUT={out}")
    return image


def _output_folder(folder: Path, name: str) -> Path:
    """Return the folder for the images of applications in `folder`.

    In a checkout it is below `folder`. If that is not writable, and in an installed package, it is in the user's cache.
    """
    if paths.in_checkout() and os.access(folder, os.W_OK):
        return folder / "build" / name
    out = paths.images() / (name or folder.name)
    make_private(out)
    for one in (paths.cache(), paths.images(), out):
        if why := danger(one):
            raise ValueError(f"{one}: {why}; delete it, or set OPENSWARM_CACHE to a folder of your own")
    return out


def _make(brain: str, image: Path, folder: Path, *arguments: str) -> None:
    """Run `make` in a folder of firmware. Raises ValueError if it fails.

    The first build of an image takes seconds, so a terminal gets a line before it.
    """
    command = ["make", "-C", str(folder), *arguments]
    if sys.stderr.isatty() and not image.exists():
        print(f"building {brain} ...", file=sys.stderr, flush=True)
    try:
        built = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise ValueError(f"--brain {brain}: `make` does not run: {error}") from None
    if built.returncode:
        raise ValueError(f"--brain {brain}: {' '.join(command)} failed:\n{built.stderr.strip()}")
