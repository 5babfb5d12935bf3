"""Compare bounds of every stack and interrupt handler of applications with what they use in a run: one table.

    python -m bench.kernel.stacks [--app NAME] [--cycles N] [--json]

The run begins with main, or without it with the first C function; stack_observer.py observes W15 at every instruction.
It feeds both UARTs, delays interrupts, and requests them in the deepest moment of every stack. Stacks are those of
main, of every thread and of the kernel; "alone" excludes what interrupts use of them. The cycles of a handler count if
it is neither interrupted nor leads to another thread; its bound assumes the greatest lengths of the kernel's lists in
the run. Bounds exclude refused messages, SYS_DSP threads and swaps of the heap's reserve if the run had none
(`--without`). Exit status 1 if a measurement exceeds its bound.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from bench.kernel.bounds import build
from bench.kernel.stack_observer import RARE, RETURN_ADDRESS, Observer
from toolchain.bounds.interference import BoundsReport, report_of
from toolchain.bounds.program import Program
from toolchain.bounds.report import BoundAnalysis
from toolchain.elf.read import read_executable

ROOT = Path(__file__).resolve().parents[2]
APPS = ROOT / "firmware" / "apps"
VALUES = {"n": 12, "m": 40, "b": 12, "s": 12, "q": 40, "i": 0, "u": 600, "d": 120, "k": 600, "w": 2}
VALUES |= {"l": 4, "c": 4, "y": 4, "v": 4, "r": 4}
"""Values of annotation names, above those of every application. No stack depends on them."""


@dataclass
class StackRow:
    """One stack (bytes) or handler (cycles) of an application; `bound` for the load of the run, None if not known."""

    app: str
    name: str
    unit: str
    bound: int | None
    seen: int

    @property
    def ratio(self) -> float | None:
        """The bound as a multiple of the measurement, None without either."""
        return self.bound / self.seen if self.bound is not None and self.seen else None

    @property
    def is_exceeded(self) -> bool:
        """Whether the measurement exceeds the bound."""
        return self.bound is not None and self.seen > self.bound


def _stacks(report: BoundsReport, start: str) -> dict[str, int | None]:
    """Return the bounds of all stacks of a report by the names of rows; `start` is the function a run begins with."""
    found: dict[str, int | None] = {start: None, **report.stacks}
    for user in report.rows:
        if user.name in found:
            found[f"{user.name} alone"] = RETURN_ADDRESS + user.bytes if user.stack_is_known else None
    return found


def rows_of(app: str, image: Path, cycles: int, values: Mapping[str, int] = VALUES) -> list[StackRow]:
    """Return the rows of one image: every stack, and every handler that occurred."""
    executable = read_executable(image.read_bytes(), str(image))
    program = Program(executable, values)
    observer = Observer(image, program)
    observer.run(cycles)
    seen = observer.nest()
    absent = [name for name in RARE if program.address(name) in program.calls.entries and name not in seen.called]
    others = [observer.start] if observer.start != "main" else []  # every report has main, with PRIVATE_VALUEs
    bounds = _stacks(report_of(Program(executable, values, absent), others), observer.start)
    used = seen.stacks | {f"{name} alone": most for name, most in seen.alone.items()}
    rows = [StackRow(app, name, "bytes", bound, used[name]) for name, bound in bounds.items() if name in used]
    handlers = BoundAnalysis(Program(executable, {**values, **seen.sizes}, absent))
    for entry, name, level in program.interrupts():
        if name in seen.handlers:
            bound = handlers.bound(name, entry, "interrupt", level).cycles
            rows.append(StackRow(app, name, "cycles", bound, seen.handlers[name]))
    return rows


def table(rows: list[StackRow]) -> str:
    """Return the table as Markdown, with the median ratios of stacks, handlers and both."""
    lines = [
        "| application | stack or handler | bound | measured | unit | ratio |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        bound = "?" if row.bound is None else f"{row.bound:,}"
        ratio = "-" if row.ratio is None else f"{row.ratio:.2f}"
        lines.append(f"| {row.app} | `{row.name}` | {bound} | {row.seen:,} | {row.unit} | {ratio} |")
    kinds = {"stacks": ["bytes"], "handlers": ["cycles"], "both": ["bytes", "cycles"]}
    medians = [f"{kind} {_median(rows, units)}" for kind, units in kinds.items()]
    return "\n".join([*lines, "", f"median ratios: {', '.join(medians)}"])


def _median(rows: list[StackRow], units: list[str]) -> str:
    ratios = [row.ratio for row in rows if row.ratio is not None and row.unit in units]
    return f"{statistics.median(ratios):.2f}" if ratios else "-"


def main() -> int:
    """Run the command; exit status 1 if a measurement exceeds its bound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--app", action="append", help="only this application (default: all with the kernel)")
    parser.add_argument("--cycles", type=int, default=600_000, help="cycles of each plain run (default 600,000)")
    parser.add_argument("--json", action="store_true", help="machine-readable output")
    options = parser.parse_args()
    names = options.app or sorted(path.parent.name for path in APPS.glob("*/main.c"))
    rows: list[StackRow] = []
    with tempfile.TemporaryDirectory(prefix="stacks-") as folder:
        for app in names:
            rows += rows_of(app, build(app, "apps", Path(folder) / app), options.cycles)
            print(f"{app}: {len(rows)} rows", file=sys.stderr)
    print(json.dumps([asdict(row) for row in rows], indent=1) if options.json else table(rows))
    return 1 if any(row.is_exceeded for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
