"""Report of a check against a baseline: as text, as Markdown for a pull request, and as plain data.

Every report ends with one verdict line. A failed check says which command accepts the new numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from emu.kernel_metrics.baseline import MetricRow

NAMES_SHOWN: Final = 3
"""Maximum number of rows that the verdict line names."""


@dataclass(frozen=True, slots=True)
class CheckReport:
    """Result of a check. `blame` lists (source line, amount) for rows that fail, the largest share first."""

    command: str
    path: str
    rows: list[MetricRow]
    blame: Mapping[str, list[tuple[str, int]]]
    accept: str
    """Command line that writes the new numbers."""

    @property
    def fails(self) -> bool:
        """Whether any row fails."""
        return any(row.fails for row in self.rows)

    @property
    def verdict(self) -> str:
        """The verdict in one line."""
        bad = [row.name for row in self.rows if row.fails]
        if not bad:
            better = sum(row.verdict == "better" for row in self.rows)
            more = f", {better} better; keep them with: {self.accept}" if better else ""
            return f"{self.command}: PASS: none of {len(self.rows)} rows is worse than in {self.path}{more}"
        names = "; ".join(bad[:NAMES_SHOWN]) + (f"; {len(bad) - NAMES_SHOWN} more" if len(bad) > NAMES_SHOWN else "")
        return (
            f"{self.command}: FAIL: {len(bad)} of {len(self.rows)} rows against {self.path}: {names}."
            f" To accept the new numbers: {self.accept}"
        )

    def _shown(self) -> list[MetricRow]:
        """Return the rows that changed: those that fail, the largest growth first, then those that are better."""
        bad = [row for row in self.rows if row.fails]
        bad.sort(key=lambda row: (row.difference is None, -abs(row.difference or 0)))
        return bad + [row for row in self.rows if not row.fails and row.old != row.new]

    def text(self) -> str:
        """Return the changed rows as a table, with the verdict line."""
        shown = self._shown()
        lines = [f"{'':52} {'baseline':>9} {'now':>9}"] if shown else []
        for row in shown:
            change = "" if row.difference is None else f"{row.difference:+,} {row.unit}"
            words = [change, "" if row.verdict == "same" else row.verdict.upper() if row.fails else row.verdict]
            words.append(f"(limit: {row.limit})" if row.limit else "")
            lines.append(f"{row.name:52} {_cell(row.old):>9} {_cell(row.new):>9}  {'  '.join(filter(None, words))}")
            lines += [f"    {amount:+6} {place}" for place, amount in self.blame.get(row.name, ())]
        return "\n".join([*lines, self.verdict])

    def markdown(self) -> str:
        """Return the changed rows as a Markdown table, for the summary of a CI job or a pull request."""
        lines = [f"### {self.command}: {'failed' if self.fails else 'passed'}", ""]
        shown = self._shown()
        if shown:
            lines += ["| number | baseline | now | difference | verdict | lines |", "|---|---:|---:|---:|---|---|"]
        for row in shown:
            change = "" if row.difference is None else f"{row.difference:+,} {row.unit}"
            places = "<br>".join(f"{amount:+} `{_escaped(place)}`" for place, amount in self.blame.get(row.name, ()))
            verdict = row.verdict + (f" ({row.limit})" if row.limit else "")
            cells = (_escaped(row.name), _cell(row.old), _cell(row.new), change, verdict, places)
            lines.append(f"| {' | '.join(cells)} |")
        same = len(self.rows) - len(shown)
        return "\n".join([*lines, "", f"{same} numbers did not change.", "", self.verdict])

    def facts(self) -> dict[str, Any]:
        """Return the comparison as plain data."""
        return {
            "baseline": self.path,
            "verdict": "fail" if self.fails else "pass",
            "text": self.verdict,
            "accept": self.accept,
            "rows": [
                {
                    "name": row.name, "unit": row.unit, "baseline": row.old, "measured": row.new,
                    "difference": row.difference, "verdict": row.verdict, "limit": row.limit or None,
                    "lines": [{"line": place, "amount": amount} for place, amount in self.blame.get(row.name, ())],
                }
                for row in self.rows
            ],
        }  # fmt: skip


def _cell(value: int | None) -> str:
    return "-" if value is None else f"{value:,}"


def _escaped(text: str) -> str:
    return text.replace("|", "\\|")
