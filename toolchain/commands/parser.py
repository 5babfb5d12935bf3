"""Argument parser of the sub-commands: unwrapped description, an example, exit status 2 for usage errors."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from emu.host.errors import CommandParser


def parser(
    command: str, description: str, example: str, help_switches: tuple[str, ...] = ("-h", "--help")
) -> argparse.ArgumentParser:
    """Return an empty parser for `python -m toolchain COMMAND`, or for `dspic-COMMAND` if that program is running."""
    called = Path(sys.argv[0]).stem
    result = CommandParser(
        prog=called if called.startswith("dspic-") else f"python -m toolchain {command}",
        description=description,
        epilog=f"example: {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
        add_help=False,
    )
    result.add_argument(*help_switches, action="help", help="show this text")
    return result
