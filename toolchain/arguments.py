"""What a word of a command line can be besides text: numbers and definitions, for argparse."""

from __future__ import annotations

import argparse

from toolchain.errors import ToolError


def integer(text: str) -> int:
    """A number in C notation, for argparse."""
    try:
        return int(text, 0)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def definition(text: str) -> tuple[str, int]:
    """NAME=VALUE of --defsym; raises `ToolError`."""
    name, equals, value = text.partition("=")
    try:
        return name, int(value, 0) if equals else 1
    except ValueError:
        raise ToolError(f"--defsym {text}: {value!r} is not a number") from None
