"""Line numbers of the statements that BOUNDS_AT annotations (include/bounds.h) name by their text."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from toolchain.errors import SourceLocation, ToolError

_ANNOTATION = re.compile(r'BOUNDS_AT\("((?:[^"\\]|\\.)*)"')
_ESCAPED = re.compile(r"\\(.)")


def definitions(source: Path) -> list[str]:
    """Return options that define `_BOUNDS_AT_N`, for an annotation that ends in line N, as the line of its statement.

    The statement is in the next function; no other line of it contains the text. Raises `ToolError` otherwise.
    """
    try:
        text = source.read_text(errors="replace")
    except OSError:
        return []  # clang reports it
    if "BOUNDS_AT(" not in text:
        return []
    lines = text.splitlines()
    return [f"-D_BOUNDS_AT_{number}={target}" for number, target in _targets(lines, source)]


def _targets(lines: list[str], source: Path) -> Iterator[tuple[int, int]]:
    for number, line in enumerate(lines, 1):
        match = _ANNOTATION.match(line)
        if match is None:
            continue
        wanted = _ESCAPED.sub(r"\1", match[1])
        end = next((k for k in range(number, len(lines)) if lines[k].startswith("}")), len(lines))
        found = [k + 1 for k in range(number, end) if wanted in lines[k] and not _ANNOTATION.match(lines[k])]
        if len(found) != 1:
            count = "no line" if not found else f"{len(found)} lines"
            raise ToolError(f"{count} of the next function contain {wanted!r}", SourceLocation(str(source), number))
        last = next((k for k in range(number, end) if ");" in lines[k - 1]), number)
        yield last, found[0]  # __LINE__ in a macro call is that of its end
