"""`arena keys`: every key of a scene with type, unit, range and default, from the schema."""

from __future__ import annotations

import argparse
import math
import textwrap
from collections.abc import Iterator
from dataclasses import fields
from typing import Any, Final, NamedTuple

from arena.scene.limits import LIMITS
from arena.scene.schema import LISTS, TABLES
from arena.trial.strict_json import json_text
from emu.host.errors import CommandParser

UNITS: Final = {"cm_s": "cm/s", "deg_s": "degrees/s",
                "cm": "cm", "deg": "degrees", "s": "s", "ms": "ms", "us": "us", "tcy": "Tcy", "n": "N", "kg": "kg",
                "counts": "ADC counts", "share": "share", "volts": "V", "hours": "h"}  # fmt: skip
"""Unit by the last one or two words of a key."""
_HEAD: Final = """# Keys of scene files

For users who write a scene: every key with its type, unit, range and default, as `arena keys --markdown` prints them.
[Writing a scene](scenes.md) shows how they work together. `[chassis]` has the keys of `[robots]` except `count`, for
scenes with `[[robots]]` tables. A default (see above) is explained in the text of its table.
"""
_IN_FILE: Final = {"groups": "[[robots]]", "kinds": "[[objects]]"}
_TYPES: Final = {
    "tuple": "list of points",
    "str": "text",
    "int": "whole number",
    "float": "number",
    "bool": "truth value",
}


class Key(NamedTuple):
    """One key of a scene. `minimum` and `maximum` are None for values without a range."""

    table: str
    key: str
    type: str
    unit: str
    minimum: float | None
    maximum: float | None
    default: Any


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(
        description="list the keys of scene files with unit, range and default", epilog="example: arena keys camera"
    )
    command.add_argument("table", nargs="?", help="list only this table, for example robots")
    command.add_argument("--json", action="store_true", help="print the keys as JSON")
    command.add_argument("--markdown", action="store_true", help="print the keys as a page of the documentation")
    return command


def run(options: argparse.Namespace) -> int:
    """Print the keys. Raises ValueError for an unknown table."""
    tables = {name: title for name, title in _tables().items() if options.table in (None, name, title.strip("[]"))}
    if not tables:
        known = ", ".join(dict.fromkeys(title.strip("[]") for title in _tables().values()))
        raise ValueError(f"there is no table {options.table!r}; known: {known}")
    if options.json:
        print(json_text([one._asdict() for name in tables for one in keys_of(name)]))
        return 0
    if options.markdown and options.table is None:
        print(_HEAD)
    for name, title in tables.items():
        print(*(_page(name, title) if options.markdown else _listing(name, title)), sep="\n")
    return 0


def _tables() -> dict[str, str]:
    """Return the heading of every table in a scene file, by the table's name in the schema."""
    return {name: f"[{name}]" for name in TABLES} | {name: _IN_FILE.get(name, f"[[{name}]]") for name in LISTS}


def keys_of(table: str) -> Iterator[Key]:
    """Yield the keys of a table of the schema."""
    kind = TABLES.get(table) or LISTS[table]
    limits, title, defaults = LIMITS[kind], _tables()[table], kind()
    for one in fields(kind):
        value = getattr(defaults, one.name)
        low, high = limits.get(one.name, (None, None))
        words = one.name.split("_")
        unit = UNITS.get("_".join(words[-2:])) or UNITS.get(words[-1], "")
        yield Key(title, one.name, _TYPES[type(value).__name__], unit, low, _finite(high), _default(value))


def _finite(value: float | None) -> float | None:
    return None if value == math.inf else value


def _default(value: Any) -> Any:
    """Return a default as JSON has it: None for nan, which stands for "random" or "the centre"."""
    return None if value != value else list(value) if isinstance(value, tuple) else value


def _range(one: Key) -> str:
    if one.minimum is None:
        return ""
    return f"{one.minimum:g} or more" if one.maximum is None else f"{one.minimum:g} to {one.maximum:g}"


def _default_text(value: Any) -> str:
    """Return a default as a scene file would have it."""
    if value is None:
        return "(see above)"
    return str(value).lower() if isinstance(value, bool) else f'"{value}"' if isinstance(value, str) else str(value)


def _cells(table: str) -> list[tuple[str, str, str, str]]:
    """Return key, type with unit, range and default of every key of a table."""
    return [(one.key, f"{one.type}, {one.unit}" if one.unit else one.type, _range(one), _default_text(one.default))
            for one in keys_of(table)]  # fmt: skip


def _description(table: str) -> str:
    """Return the docstrings of the class of a table and of its bases."""
    kind = TABLES.get(table) or LISTS[table]
    texts = [one.__doc__ or "" for one in kind.__mro__ if one is not object]
    return "\n\n".join(textwrap.dedent("    " + text).strip() for text in texts)


def _listing(table: str, title: str) -> Iterator[str]:
    """Yield the lines of a table for a terminal."""
    rows = _cells(table)
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    yield title
    yield textwrap.indent(_description(table), "  ")
    for row in rows:
        line = "  ".join(cell.ljust(width) for cell, width in zip(row[:3], widths, strict=True))
        yield f"    {line}  {row[3]}".rstrip()
    yield ""


def _page(table: str, title: str) -> Iterator[str]:
    """Yield the lines of a table for the documentation."""
    yield from (f"## {title}", "", _description(table), "", "| key | type | range | default |", "|---|---|---|---|")
    for key, kind, span, default in _cells(table):
        yield f"| `{key}` | {kind} | {span} | {f'`{default}`' if default[:1] != '(' else default} |"
    yield ""
