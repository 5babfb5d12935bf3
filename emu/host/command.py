"""Parts common to the commands of `python -m emu`: option parser, argument types, error class."""

from __future__ import annotations

import argparse
import contextlib
import re
import sys
from fractions import Fraction
from typing import Final, NoReturn

from emu.host.errors import JSON, CommandParser, report_error
from emu.host.exit_status import BAD_INPUT, BAD_INPUT_AS_STATUS

TEN_YEARS: Final = 10 * 366 * 24 * 3600
"""Maximum simulated time that a command accepts, in s."""


class CommandError(Exception):
    """Error made by the user, reported in one line."""


class Parser(CommandParser):
    """Argument parser that keeps the layout of descriptions. Under `--exit-code` it exits with 126 on errors."""

    def __init__(self, command: str, description: str, example: str) -> None:
        super().__init__(
            prog=f"emu {command}",
            description=description,
            epilog=f"example: {example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )

    def error(self, message: str) -> NoReturn:
        """Print an error in one line and exit."""
        status = BAD_INPUT_AS_STATUS if "--exit-code" in self.arguments else BAD_INPUT
        sys.exit(report_error(f"{self.prog}: {message} (see {self.prog} --help)", status, JSON in self.arguments))


def seconds(text: str) -> Fraction:
    """Parse a time of more than 0 s and at most ten years exactly: `5`, `0.25` or `1/3`. Raises ArgumentTypeError."""
    if re.fullmatch(r"\d{1,12}(\.\d{0,12})?|\.\d{1,12}|\d{1,12}/\d{1,12}", text):
        with contextlib.suppress(ZeroDivisionError):
            value = Fraction(text)
            if 0 < value <= TEN_YEARS:
                return value
    raise argparse.ArgumentTypeError(f"expected seconds above 0, like 5 or 0.25, not {text!r}")


def count(text: str) -> int:
    """Parse a whole number of 0 or more. Raises ArgumentTypeError."""
    if re.fullmatch(r"\d{1,9}", text, re.ASCII):
        return int(text)
    raise argparse.ArgumentTypeError(f"expected a number, 0 or more, not {text!r}")


def port(text: str) -> int:
    """Parse a TCP port number, 0 to 65535. Raises ArgumentTypeError."""
    if re.fullmatch(r"\d{1,5}", text, re.ASCII) and int(text) < 1 << 16:
        return int(text)
    raise argparse.ArgumentTypeError(f"expected a port from 0 to 65535, not {text!r}")


def cycles(text: str) -> int:
    """Parse a number of instruction cycles of 1 or more, decimal or 0x. Raises ArgumentTypeError."""
    if re.fullmatch(r"\d{1,18}|0x[0-9a-fA-F]{1,15}", text):
        value = int(text, 16 if text.startswith("0x") else 10)
        if value:
            return value
    raise argparse.ArgumentTypeError(f"expected a number of cycles above 0, not {text!r}")
