"""Errors of commands: one line on standard error, and with --json also one JSON object on standard output."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any, Final, NoReturn

from emu.host.exit_status import BAD_INPUT

JSON: Final = "--json"
"""Option of the commands that print their result as JSON."""


def report_error(message: str, status: int, as_json: bool) -> int:
    """Print an error and return `status`; `as_json`: also as JSON on standard output."""
    print(message, file=sys.stderr, flush=True)
    if as_json:
        print_json_error(message, status)
    return status


def print_json_error(message: str, status: int) -> None:
    """Print `{"error": {"message": ..., "status": ...}}` on standard output."""
    import json  # imported only here: most commands start without it

    print(json.dumps({"error": {"message": message, "status": status}}))


class CommandParser(argparse.ArgumentParser):
    """Argument parser that reports usage errors as `report_error` does. `arguments` are those that it parses."""

    arguments: Sequence[str] = ()

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse `args`, by default those of the process; return options and unknown arguments."""
        self.arguments = sys.argv[1:] if args is None else list(args)
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Print usage and error, and exit with status 2."""
        if JSON in self.arguments:
            print_json_error(f"{self.prog}: {message}", BAD_INPUT)
        super().error(message)
