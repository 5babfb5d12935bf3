"""`openswarm path`: where things lie, for Makefiles and scripts."""

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
    "cache": (paths.cache, "everything that can be made again"),
    "python": (lambda: sys.executable, "the interpreter these commands run in"),
}


def parser() -> argparse.ArgumentParser:
    """The options of the command."""
    texts = "\n".join(f"    {name:10}{text}" for name, (_, text) in PLACES.items())
    made = made_parser("path", f"Print where something is:\n\n{texts}", "make -C $(openswarm path firmware) APP=hello")
    made.add_argument("what", choices=tuple(PLACES), help="what to look for")
    return made


def run(options: argparse.Namespace) -> int:
    """Exit status 0."""
    print(PLACES[options.what][0]())
    return DONE
