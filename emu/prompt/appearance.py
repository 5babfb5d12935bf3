"""Appearance of text in a terminal: lines of at most 80 columns, and colours."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from typing import Final, Literal

COLUMNS: Final = 80
INDENT: Final = 4
"""Indentation of the lines that continue a folded line."""
COLOUR_CHOICES: Final = ("auto", "always", "never")
Style = Literal["", "stop", "location", "here", "fault"]
"""Kinds of text: reason of a stop, its location, the current source line, faults and refused commands."""
CODES: Final[dict[Style, str]] = {"stop": "36", "location": "1", "here": "32", "fault": "31"}
"""SGR parameters of ECMA-48: cyan, bold, green, red."""


def has_colours(choice: str) -> bool:
    """Whether output has colours for a choice of COLOUR_CHOICES.

    "auto": at a terminal, unless TERM is "dumb" or NO_COLOR is set and not empty (https://no-color.org).
    """
    is_refused = bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"
    return choice == "always" or (choice == "auto" and sys.stdout.isatty() and not is_refused)


def coloured(text: str, style: Style) -> str:
    """Return the text with the colour of a style, line by line."""
    if style not in CODES:
        return text
    return "\n".join(f"\x1b[{CODES[style]}m{line}\x1b[0m" if line else line for line in text.split("\n"))


def fold(text: str, indent: int = INDENT) -> str:
    """Return the text with lines of at most COLUMNS columns.

    A line ends between words, never between a name, its equals sign and its value. A longer word stays whole.
    """
    return "\n".join(part for line in text.split("\n") for part in _folded(line, indent))


def _folded(line: str, indent: int) -> Iterator[str]:
    while len(line) > COLUMNS:
        ends = [at for at in range(1, len(line)) if line[at] == " " and _separates_pairs(line, at)]
        at = max((one for one in ends if one <= COLUMNS), default=min(ends, default=0))
        if not line[:at].strip():
            break
        yield line[:at].rstrip()
        line = " " * indent + line[at:].lstrip()
    yield line


def _separates_pairs(line: str, at: int) -> bool:
    before, after = line[:at].rstrip(), line[at:].lstrip()
    return bool(before) and bool(after) and not before.endswith("=") and not after.startswith("=")
