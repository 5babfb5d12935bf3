"""Parsers of command line arguments for argparse: numbers and symbol definitions."""

from __future__ import annotations

import argparse

from toolchain.errors import ToolError


def integer(text: str) -> int:
    """Parse a number in C notation; raise argparse's ArgumentTypeError for other text."""
    try:
        return int(text, 0)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def definition(text: str) -> tuple[str, int]:
    """Parse NAME=VALUE of --defsym; raise `ToolError` for other text."""
    name, equals, value = text.partition("=")
    try:
        return name, int(value, 0) if equals else 1
    except ValueError:
        raise ToolError(f"--defsym {text}: {value!r} is not a number") from None
