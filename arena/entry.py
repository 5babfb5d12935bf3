"""Entry point of the command `arena`, which works without the packages of the optional extras."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from importlib.metadata import requires

from emu.host.errors import JSON, report_error
from emu.host.exit_status import BAD_INPUT
from emu.host.installation import install_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `arena.cli.main`. If a package of an extra is missing, print how to install it and return status 2."""
    try:
        from arena.cli import main as run

        return run(arguments)
    except ModuleNotFoundError as error:
        extra = extra_with(error.name or "")
        if extra is None:
            raise
        words = sys.argv[1:] if arguments is None else arguments
        return report_error(f"arena: {error.name} is not installed: {install_command(extra)}", BAD_INPUT, JSON in words)


def extra_with(module: str) -> str | None:
    """Return the extra that requires `module`, preferably `arena`; None if no extra does."""
    package = module.partition(".")[0].replace("_", "-")
    found = [re.search(r"extra *== *[\"'](\w+)", line) for line in requires("openswarm") or ()
             if re.match(rf"{re.escape(package)}\b(?!-)", line.replace("_", "-"))]  # fmt: skip
    extras = {one[1] for one in found if one} - {"test", "docs"}
    return min(extras, key=lambda extra: (extra != "arena", extra), default=None)
