"""Numbers on the command line, checked where they are read: a wrong one ends in a usage message and exit status 2."""

from __future__ import annotations

import argparse
import math


def count(text: str) -> int:
    """A whole number, 1 or more."""
    return _whole(text, 1)


def count_or_none(text: str) -> int:
    """A whole number, 0 or more."""
    return _whole(text, 0)


def _whole(text: str, least: int) -> int:
    try:
        value = int(text)
    except ValueError:
        value = least - 1
    if value < least:
        raise argparse.ArgumentTypeError(f"{text!r} must be a whole number, {least} or more")
    return value


def duration(text: str) -> float:
    """A time or a factor: positive and no more than 1e7, four months in seconds."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value <= 1e7:
        raise argparse.ArgumentTypeError(f"{text!r} must be positive, 1e7 at most")
    return value


def port(text: str) -> int:
    """A TCP port, 0 = any."""
    value = _whole(text, 0)
    if value > 65535:
        raise argparse.ArgumentTypeError(f"{text!r} must be 0 to 65535")
    return value
