"""What every command of `python -m emu` is made with: its parser, its exit statuses, its way to refuse."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Final, NoReturn

EXIT_OK: Final = 0
EXIT_FAULT: Final = 1
EXIT_BAD_INPUT: Final = 2
"""Exit statuses of design §10."""
BAD_INPUT_STATUS: Final = 126
"""Bad input or usage with --exit-code (design §10)."""


class CommandError(Exception):
    """A mistake of the caller, told in one line."""


class Parser(argparse.ArgumentParser):
    """argparse that keeps descriptions as written and ends with status 126 when `--exit-code` is wanted."""

    def __init__(self, command: str, description: str, example: str) -> None:
        super().__init__(
            prog=f"emu {command}",
            description=description,
            epilog=f"example: {example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        self.arguments: Sequence[str] = ()

    def error(self, message: str) -> NoReturn:
        """Print what is wrong in one line and leave."""
        print(f"{self.prog}: {message} (see {self.prog} --help)", file=sys.stderr)
        sys.exit(BAD_INPUT_STATUS if "--exit-code" in self.arguments else EXIT_BAD_INPUT)
