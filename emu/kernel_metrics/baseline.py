"""Baselines: exact numbers kept in the repository. --update writes them, --check compares; any increase fails.

Input: numbers by name, each with its distribution over source lines. Outputs: `Row`s of a table, and a JSON file. The
file identifies a source line by file and code text, so that moved lines and changed comments do not count as changes.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from emu.host.files import atomic_text_file, read_file

GREW_SHOWN: Final = 4
"""Maximum number of source lines shown for a number that grew."""

C_COMMENT: Final = re.compile(r"/\*.*?(\*/|$)|//.*")
ASSEMBLY_COMMENT: Final = re.compile(r"/\*.*?(\*/|$)|//.*|;.*")


@dataclass(frozen=True, slots=True)
class Number:
    """A measured value and its distribution over source lines."""

    value: int
    where: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a comparison. `old` is None for a new number, `new` for a number that is no longer measured."""

    name: str
    old: int | None
    new: int | None
    grew: tuple[tuple[str, int], ...] = ()

    @property
    def is_worse(self) -> bool:
        """Whether this row makes a check fail: the number grew, or is no longer measured."""
        return self.new is None or (self.old is not None and self.new > self.old)


class Sources:
    """Names of source lines in the baseline: file below `firmware/`, and the line's code if it can be read."""

    def __init__(self, image_path: str) -> None:
        self._roots: Final = [Path(), Path("firmware"), *Path(image_path).resolve().parents[:4]]
        self._files: Final[dict[str, list[str]]] = {}

    def name(self, place: str) -> str:
        """Convert `/somewhere/firmware/openswarm/kernel/event.c:93` to `kernel/event.c: return m;`."""
        file, _, line = place.rpartition(":")
        if not file or not line.isdecimal():
            return place
        lines = self._lines(file)
        number = int(line)
        code = without_comments(lines[number - 1], file) if 0 < number <= len(lines) else ""
        return f"{short(file)}: {code or f'line {number}'}"

    def names(self, where: Mapping[str, int]) -> dict[str, int]:
        """Return the counts with names instead of line numbers as keys."""
        named: Counter[str] = Counter()
        for place, count in where.items():
            named[self.name(place)] += count
        return dict(sorted(named.items()))

    def _lines(self, file: str) -> list[str]:
        if file not in self._files:
            self._files[file] = []
            for root in self._roots:
                try:
                    text = (root / file).read_text(encoding="utf-8", errors="replace")
                except OSError:
                    continue
                self._files[file] = text.splitlines()
                break
        return self._files[file]


def without_comments(line: str, file: str) -> str:
    """Return the code of a source line without comments and with normalised white space."""
    comment = ASSEMBLY_COMMENT if file.endswith((".s", ".S")) else C_COMMENT
    return " ".join(comment.sub("", line).split())


def short(file: str) -> str:
    """Return a path without the folders that differ between checkouts."""
    for folder in ("/openswarm/", "/apps/", "/runtime/"):
        _, found, rest = f"/{file}".rpartition(folder)
        if found:
            return rest if folder == "/openswarm/" else folder[1:] + rest
    return Path(file).name


def save(path: str, numbers: Mapping[str, Number]) -> None:
    """Write a baseline atomically."""
    table = {name: {"value": number.value, "where": number.where} for name, number in numbers.items()}
    with atomic_text_file(path) as stream:
        json.dump(table, stream, indent=1)
        stream.write("\n")


def load(path: str) -> dict[str, Number]:
    """Read a baseline. Raises ValueError if the file is not a baseline, OSError if it cannot be read."""
    try:
        table: dict[str, Any] = json.loads(read_file(path))
        return {
            name: Number(int(row["value"]), {str(k): int(v) for k, v in row["where"].items()})
            for name, row in table.items()
        }
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        raise ValueError(f"{path}: is not a baseline written by --update") from None


def compare(old: Mapping[str, Number], new: Mapping[str, Number]) -> list[Row]:
    """Return one row per name: first in the order of `new`, then the names that are only in `old`."""
    rows = []
    for name, number in new.items():
        before = old.get(name)
        grew: tuple[tuple[str, int], ...] = ()
        if before is not None and number.value > before.value:
            more = {place: count - before.where.get(place, 0) for place, count in number.where.items()}
            ranked = sorted(more.items(), key=lambda item: (-item[1], item[0]))
            grew = tuple((place, count) for place, count in ranked[:GREW_SHOWN] if count > 0)
        rows.append(Row(name, before.value if before else None, number.value, grew))
    return rows + [Row(name, number.value, None) for name, number in old.items() if name not in new]


def table(rows: list[Row], unit: str) -> str:
    """Return the comparison as a text table."""
    lines = [f"{'':58} {'baseline':>9} {'now':>9}"]
    for row in rows:
        old = "-" if row.old is None else f"{row.old:,}"
        new = "gone" if row.new is None else f"{row.new:,}"
        change = ""
        if row.old is not None and row.new is not None and row.old != row.new:
            change = f"  {row.new - row.old:+,} {unit}"
        lines.append(f"{row.name:58} {old:>9} {new:>9}{change}{'  WORSE' if row.is_worse else ''}")
        lines += [f"    {count:+6} {place}" for place, count in row.grew]
    return "\n".join(lines)
