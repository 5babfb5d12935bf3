"""`openswarm new`: creates a project that builds with make and CMake, runs on the emulator and has a test."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

from emu.host.exit_status import DONE
from emu.host.installation import install_command, wheel_name
from openswarm.commands import made_parser

TEMPLATE: Final = Path(__file__).resolve().parents[1] / "template"
HIDDEN: Final = {"vscode": ".vscode", "github": ".github", "gitignore": ".gitignore"}
"""Names of template files that are hidden files in a project: build tools omit hidden files from packages."""
NAME: Final = "@PROJECT@"
INSTALL, WHEEL = "@INSTALL@", "@WHEEL@"
DESCRIPTION: Final = """\
Set up a project in a new folder: an application of OpenSwarm with two threads and an event in src/, a Makefile,
CMakeLists.txt, a test that runs the firmware on the emulated e-puck, a workflow for GitHub, settings for VS Code.
`make` builds it, `make run` runs it, `make test` tests it (with pytest), `make check` compares memory and cycles with
the baselines in test/, which are measured now (some seconds; not with --no-baselines).

Exit status: 0 done, 2 the folder exists or cannot be made."""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    made = made_parser("new", DESCRIPTION, "openswarm new myrobot")
    made.add_argument("folder", type=Path, help="where; its last part is the project's name (a-z, 0-9, - and _)")
    made.add_argument("--no-baselines", action="store_true", help="do not build the project and measure its baselines")
    return made


def run(options: argparse.Namespace) -> int:
    """Create the project; return exit status 0. Raises ValueError for an invalid name, OSError for the folder."""
    folder: Path = options.folder
    name = folder.resolve().name
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name):
        raise ValueError(f"{name!r} cannot be a project's name: expected a letter, then letters, digits, - and _")
    if folder.exists() or folder.is_symlink():
        raise ValueError(f"{folder} exists already")
    if re.search(r"\s", str(folder.resolve())):
        raise ValueError(f"{folder.resolve()}: make cannot work in a folder with a space in its path")
    create(folder, name)
    if not options.no_baselines:
        measure(folder)
    print(f"{folder} is ready. Next:\n    cd {folder}\n    make run")
    return DONE


def measure(folder: Path) -> None:
    """Build the project and write its baselines; say how to do it later if make fails or is not installed."""
    words = ["make", "-s", "-C", str(folder), "baselines", f"OPENSWARM={sys.executable} -m openswarm"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        reason = "" if done.returncode == 0 else (done.stderr.strip().splitlines() or ["no message"])[0]
    except FileNotFoundError:
        reason = "make is not installed"
    if reason:
        print(f"openswarm new: the baselines are missing; `make baselines` writes them: {reason}", file=sys.stderr)


def create(folder: Path, name: str) -> None:
    """Copy the template with the project's name into a folder, completely or not at all."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=f".{name}.", dir=folder.parent))
    try:
        for source in sorted(path for path in TEMPLATE.rglob("*") if path.is_file() and path.suffix != ".pyc"):
            parts = source.relative_to(TEMPLATE).parts
            target = scratch.joinpath(*(HIDDEN.get(part, part).replace("PROJECT", name) for part in parts))
            target.parent.mkdir(parents=True, exist_ok=True)
            text = source.read_text(encoding="utf-8")
            for mark, value in ((NAME, name), (INSTALL, install_command(of_wheel=True)), (WHEEL, wheel_name())):
                text = text.replace(mark, value)
            target.write_text(text, encoding="utf-8")
        scratch.chmod(0o777 & ~_umask())
        scratch.rename(folder)
    except BaseException:
        shutil.rmtree(scratch, ignore_errors=True)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
