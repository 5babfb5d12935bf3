"""Commands of `openswarm`, one module each; `openswarm.cli.Command` is their interface."""

from __future__ import annotations

import argparse

from emu.host.errors import CommandParser


def made_parser(command: str, description: str, example: str) -> argparse.ArgumentParser:
    """Return an argument parser without options whose help shows the description verbatim and an example."""
    return CommandParser(
        prog=f"openswarm {command}",
        description=description,
        epilog=f"example: {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
