"""Types of command-line arguments; an invalid value ends the command with a usage message and exit status 2."""

from __future__ import annotations

import argparse
import math
from typing import Final

LONGEST: Final = 1e7
"""Largest value of a duration, in the unit of its option."""


def count(text: str) -> int:
    """Parse a whole number of 1 or more."""
    return _parse_whole(text, 1)


def count_or_none(text: str) -> int:
    """Parse a whole number of 0 or more."""
    return _parse_whole(text, 0)


def _parse_whole(text: str, least: int) -> int:
    try:
        value = int(text)
    except ValueError:
        value = least - 1
    if value < least:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number of {least} or more")
    return value


def duration(text: str) -> float:
    """Parse a positive number of at most 1e7: a time in s or min, or a factor."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value <= LONGEST:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a positive number of at most 1e7")
    return value


def removed_processes(_text: str) -> int:
    """Refuse `--processes`, an option that no longer exists."""
    raise argparse.ArgumentTypeError("the option no longer exists: use `--jobs N` for threads of one trial")


def port(text: str) -> int:
    """Parse a TCP port; 0 is any free port."""
    value = _parse_whole(text, 0)
    if value > 65535:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a port from 0 to 65535")
    return value
