"""Find the image of a `--brain`: build an application of the project, or take the file."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Final

import emu
from emu.host import paths
from emu.host.private_folder import danger, make_private

APPLICATIONS: Final = {"openswarm": "clustering", "bare": "clustering-bare"}
"""Applications of firmware/apps with a name of their own as a brain."""


def image_for(brain: str, home: Path = Path()) -> Path | None:
    """Return the image of a brain: an application of the project, which is built, or a file, relative to `home`.

    Returns None for `scripted`. Raises LoadError if the file is not an image, ValueError for an unknown name or a
    failed build.
    """
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
    folder = paths.firmware()
    # an installed package or a checkout may not be writable: images then go into the user's cache
    is_own_folder = paths.in_checkout() and os.access(folder, os.W_OK)
    out = folder / "build" / application if is_own_folder else paths.images() / application
    if not is_own_folder:
        make_private(out)
        for one in (paths.cache(), paths.images(), out):
            if why := danger(one):
                raise ValueError(f"{one}: {why}; delete it, or set OPENSWARM_CACHE to a folder of your own")
    command = ["make", "-C", str(folder), f"APP={application}", f"OUT={out}", f"PYTHON={sys.executable}"]
    try:
        built = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise ValueError(f"--brain {brain}: `make` does not run: {error}") from None
    if built.returncode:
        raise ValueError(f"--brain {brain}: {' '.join(command)} failed:\n{built.stderr.strip()}")
    return out / "firmware.elf"
