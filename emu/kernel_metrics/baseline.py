"""Baselines: exact numbers kept in a repository. --update writes them, --check compares them.

A number that grew fails a check, and so does a row that is new or no longer measured. A row of the file may have a
limit instead: `"limit": "at most 400"`, `"limit": "at least 20 %"`. `docs/baselines.md` describes the file.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Final

from emu.host.files import atomic_text_file, read_file

SCHEMA: Final = "openswarm-baseline"
VERSION: Final = 2
"""Version of the file format. Files of version 1 have no key `schema`."""
_LIMIT: Final = re.compile(r"at (least|most) (\d{1,9}(?:\.\d{1,3})?)( ?%)?")
_LIMIT_FORM: Final = '"at least 20 %" or "at most 400"'
_KEYS: Final = frozenset(("schema", "version", "command", "conditions", "rows", "code"))
_ROW_KEYS: Final = frozenset(("value", "unit", "of", "where", "limit", "gated"))

Where = Mapping[str, Mapping[str, int]]
"""Distribution of a number: amounts by function (or source file) and by instruction index (or symbol)."""


@dataclass(frozen=True, slots=True)
class Metric:
    """A measured value. `of` is the whole that a limit in percent refers to."""

    value: int
    unit: str = "bytes"
    of: int | None = None
    where: Where = field(default_factory=dict)
    more_is_better: bool = False
    is_gated: bool = True
    """Whether growth fails a check. A number that is not gated is only compared with a limit of the baseline."""


@dataclass(frozen=True, slots=True)
class StoredRow:
    """A row of a baseline file."""

    value: int
    where: Where = field(default_factory=dict)
    limit: str = ""
    is_gated: bool = True


@dataclass(frozen=True, slots=True)
class Baseline:
    """Content of a baseline file: rows, the conditions of their measurement, and the code that was measured."""

    command: str
    conditions: Mapping[str, str]
    rows: Mapping[str, StoredRow]
    code: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Instructions by function, for the attribution of a difference to source lines."""


@dataclass(frozen=True, slots=True)
class MetricRow:
    """Comparison of one number. `old` is None for a new number, `new` for a number that is no longer measured."""

    name: str
    unit: str
    old: int | None
    new: int | None
    verdict: str
    """"same", "better", "worse", "over its limit", "missing in the baseline" or "no longer measured"."""
    limit: str = ""

    @property
    def fails(self) -> bool:
        """Whether this row makes a check fail."""
        return self.verdict not in ("same", "better")

    @property
    def difference(self) -> int | None:
        """New value minus old value, None if one of them is missing."""
        return None if self.old is None or self.new is None else self.new - self.old


def save(path: str, baseline: Baseline, numbers: Mapping[str, Metric]) -> None:
    """Write a baseline atomically. `baseline.rows` holds the limits to keep, by row."""
    rows = {}
    for name, number in numbers.items():
        row: dict[str, Any] = {"value": number.value, "unit": number.unit}
        if number.of is not None:
            row["of"] = number.of
        if not number.is_gated:
            row["gated"] = False
        if number.where:
            row["where"] = {place: dict(parts) for place, parts in number.where.items()}
        stored = baseline.rows.get(name)
        if stored is not None and stored.limit:
            row["limit"] = stored.limit
        rows[name] = row
    head = {"schema": SCHEMA, "version": VERSION, "command": baseline.command, "conditions": dict(baseline.conditions)}
    with atomic_text_file(path) as stream:
        stream.write("{\n")
        stream.writelines(f" {json.dumps(key)}: {json.dumps(value)},\n" for key, value in head.items())
        stream.write(f' "rows": {_one_a_line(rows)},\n "code": {_one_a_line(baseline.code)}\n}}\n')


def _one_a_line(table: Mapping[str, Any]) -> str:
    """Return a JSON object with one key per line, so that a version control system shows changed rows."""
    lines = [f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in table.items()]
    return "{\n" + ",\n".join(lines) + "\n }" if lines else "{}"


def load(path: str) -> Baseline:
    """Read a baseline. Raises ValueError that names the unreadable key, OSError if the file cannot be read."""
    try:
        table = json.loads(read_file(path))
    except (ValueError, RecursionError):
        raise ValueError(f"{path}: is not a baseline written by --update: it is no JSON") from None
    if not isinstance(table, dict) or table.get("schema") != SCHEMA:
        raise ValueError(f'{path}: schema: expected "{SCHEMA}"; write the file again with --update')
    if table.get("version") != VERSION:
        found = table.get("version")
        raise ValueError(f"{path}: version: expected {VERSION}, not {found!r}; write the file again with --update")
    for key in sorted(_KEYS ^ table.keys()):
        raise ValueError(f"{path}: {key}: {'is missing' if key in _KEYS else 'is no key of a baseline'}")
    for key, kind in (("command", str), ("conditions", dict), ("rows", dict), ("code", dict)):
        if not isinstance(table[key], kind):
            raise ValueError(f"{path}: {key}: expected {'text' if kind is str else 'an object'}")
    conditions = {str(key): str(value) for key, value in table["conditions"].items()}
    rows = {name: _row(f"{path}: rows.{name}", row) for name, row in table["rows"].items()}
    return Baseline(table["command"], conditions, rows, _code(path, table["code"]))


def _row(place: str, row: Any) -> StoredRow:
    if not isinstance(row, dict):
        raise ValueError(f"{place}: expected an object")
    for key in sorted(row.keys() - _ROW_KEYS):
        raise ValueError(f"{place}.{key}: is no key of a row")
    value = row.get("value")
    if not isinstance(value, int) or isinstance(value, bool):
        raise ValueError(f"{place}.value: expected a whole number, not {value!r}")
    where = row.get("where", {})
    is_where = isinstance(where, dict) and all(
        isinstance(parts, dict) and all(isinstance(count, int) for count in parts.values()) for parts in where.values()
    )
    if not is_where:
        raise ValueError(f"{place}.where: expected whole numbers by place and part")
    limit = row.get("limit", "")
    if not isinstance(limit, str) or (limit and _LIMIT.fullmatch(limit) is None):
        raise ValueError(f"{place}.limit: expected {_LIMIT_FORM}, not {limit!r}")
    if limit.endswith("%") and not isinstance(row.get("of"), int):
        raise ValueError(f"{place}.limit: {limit!r} needs a row that is part of a whole; give a number instead")
    return StoredRow(value, where, limit, row.get("gated", True) is not False)


def _code(path: str, code: dict[str, Any]) -> dict[str, tuple[str, ...]]:
    for name, lines in code.items():
        if not isinstance(lines, list) or not all(isinstance(line, str) for line in lines):
            raise ValueError(f"{path}: code.{name}: expected a list of instructions")
    return {name: tuple(lines) for name, lines in code.items()}


def compare(old: Mapping[str, StoredRow], new: Mapping[str, Metric]) -> list[MetricRow]:
    """Return one row per name: first in the order of `new`, then the names that are only in `old`."""
    rows = []
    for name, number in new.items():
        stored = old.get(name)
        if stored is None:
            verdict = "missing in the baseline" if number.is_gated else "same"
            rows.append(MetricRow(name, number.unit, None, number.value, verdict))
        else:
            rows.append(
                MetricRow(name, number.unit, stored.value, number.value, _verdict(stored, number), stored.limit)
            )
    gone = [name for name, row in old.items() if name not in new and (row.is_gated or row.limit)]
    return rows + [MetricRow(name, "", old[name].value, None, "no longer measured", old[name].limit) for name in gone]


def _verdict(stored: StoredRow, number: Metric) -> str:
    gain = (number.value - stored.value) * (1 if number.more_is_better else -1)
    if stored.limit:
        return ("better" if gain > 0 else "same") if _within(stored.limit, number) else "over its limit"
    if gain < 0:
        return "worse" if number.is_gated else "same"
    return "better" if gain > 0 else "same"


def _within(limit: str, number: Metric) -> bool:
    """Whether a number keeps a limit of the form that `load` has checked."""
    found = _LIMIT.fullmatch(limit)
    assert found is not None
    amount = Fraction(found[2])
    if found[3]:
        amount = amount * (number.of or 0) / 100
    return number.value >= amount if found[1] == "least" else number.value <= amount
