"""Completion of expressions and console commands."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from emu.dap.console import COMMANDS
from emu.debug.dwarf.location import Unavailable
from emu.debug.expressions.expression import ExpressionError, evaluate
from emu.debug.frame import Frame
from emu.debug.inspector import Inspector
from emu.debug.value import Value

LAST: Final = re.compile(r"(?:([A-Za-z_$][\w.\[\]>-]*?)(?:\.|->))?([A-Za-z_$]?\w*)$")
"""Splits a text into the expression before the last dot or arrow, if there is one, and the beginning of a name."""
MOST: Final = 500
Name = tuple[str, str]
"""A completed name and its kind, as the protocol defines it."""


def completions(inspector: Inspector, frame: Frame | None, text: str) -> tuple[list[Name], int]:
    """Return the sorted completions of `text`, and how many of its last characters they replace."""
    if text.startswith("/") and " " not in text:
        return [(f"/{word}", "keyword") for word in COMMANDS if word.startswith(text[1:])], len(text)
    match = LAST.search(text)
    whole, begun = (match[1], match[2]) if match is not None else (None, "")
    names = _members(inspector, frame, whole) if whole else _all(inspector, frame)
    found = {name: kind for name, kind in names if name.startswith(begun)}
    return sorted(found.items())[:MOST], len(begun)


def _members(inspector: Inspector, frame: Frame | None, whole: str) -> Iterator[Name]:
    try:
        value = evaluate(inspector, whole, frame)
        if not isinstance(value, Value):
            return
        sfr = inspector.image.chip.sfrs.get(value.name)
        yield from ((name, "property") for name in (sfr.fields if sfr is not None else ()))
        kind = value.type.bare
        target = kind.target if kind.kind == "pointer" and kind.target is not None else kind
        yield from ((one.name, "field") for one in target.bare.members if one.name)
    except (ExpressionError, Unavailable):
        return


def _all(inspector: Inspector, frame: Frame | None) -> Iterator[Name]:
    """Yield all visible names. A later name hides an earlier equal one."""
    prefix = inspector.processor.symbol_prefix
    symbols = (one for one in inspector.image.symbols.all if one.names_content)
    for one in symbols:
        yield one.name.removeprefix(prefix), "function" if one.space == "code" else "variable"
    yield from ((name, "enum") for name in inspector.debug.constants)
    yield from ((name, "variable") for name in inspector.debug.globals)
    yield from ((name, "property") for name in inspector.image.chip.sfrs)
    yield from ((name, "property") for name in inspector.processor.register_names)
    yield from ((name, "property") for name in ("PC", "cycle"))
    if frame is not None:
        unit = frame.scopes[0].unit if frame.scopes else -1
        yield from ((name, "variable") for name in inspector.debug.statics.get(unit, {}))
        yield from ((one.name, "variable") for one in inspector.variables(frame))
