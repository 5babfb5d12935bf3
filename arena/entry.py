"""Where the command `arena` begins: what it needs beyond the emulator is an extra, and may not be there."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from importlib.metadata import requires

from emu.host.exit_status import BAD_INPUT


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `arena.cli.main`. A package of an extra that is not installed ends in one line and status 2."""
    try:
        from arena.cli import main as run

        return run(arguments)
    except ModuleNotFoundError as error:
        extra = extra_with(error.name or "")
        if extra is None:
            raise
        print(f"arena: {error.name} is not installed: pip install 'openswarm[{extra}]'", file=sys.stderr)
        return BAD_INPUT


def extra_with(module: str) -> str | None:
    """The extra that brings a module, by this package's own requirements; the arena's own before others."""
    package = module.partition(".")[0].replace("_", "-")
    found = [re.search(r"extra *== *[\"'](\w+)", line) for line in requires("openswarm") or ()
             if re.match(rf"{re.escape(package)}\b(?!-)", line.replace("_", "-"))]  # fmt: skip
    extras = {one[1] for one in found if one} - {"test", "docs"}
    return min(extras, key=lambda extra: (extra != "arena", extra), default=None)
