"""`openswarm path`: prints paths of the installation, for Makefiles and scripts."""

from __future__ import annotations

import argparse
import sys
from typing import Final

from emu.host import paths
from emu.host.exit_status import DONE
from openswarm.commands import made_parser

PLACES: Final = {
    "firmware": (paths.firmware, "the kernel, with the Makefile that builds applications"),
    "cmake": (paths.cmake, "CMake's toolchain file openswarm.cmake"),
    "cache": (paths.cache, "compiled code and images, rebuilt on demand"),
    "python": (lambda: sys.executable, "the interpreter these commands run in"),
}


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    texts = "\n".join(f"    {name:10}{text}" for name, (_, text) in PLACES.items())
    made = made_parser("path", f"Print a path:\n\n{texts}", "make -C $(openswarm path firmware) APP=hello")
    made.add_argument("what", choices=tuple(PLACES), help="which path to print")
    return made


def run(options: argparse.Namespace) -> int:
    """Print the path; return exit status 0."""
    print(PLACES[options.what][0]())
    return DONE
