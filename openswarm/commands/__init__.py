"""One module per command of `openswarm`; see `openswarm.cli` for what a command module must have."""

from __future__ import annotations

import argparse


def made_parser(command: str, description: str, example: str) -> argparse.ArgumentParser:
    """An empty parser for a command, with its description kept as written and an example."""
    return argparse.ArgumentParser(
        prog=f"openswarm {command}",
        description=description,
        epilog=f"example: {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
