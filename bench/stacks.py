"""Compare bounds of every stack and interrupt handler of applications with what they use in a run: one table.

`python -m bench.stacks [--app NAME] [--cycles N] [--json]`. The run begins with main; W15 is observed at every
instruction. Stacks are those of main, of every thread and of the kernel; "alone" excludes what interrupts use of
them. The cycles of a handler count if it is neither interrupted nor leads to another thread. Exit status 1 if a
measurement exceeds its bound.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import emu  # noqa: E402
from bench.bounds import build  # noqa: E402
from emu.system.events import NEVER  # noqa: E402
from toolchain.bounds.interference import SECOND_STACK, report_of  # noqa: E402
from toolchain.bounds.program import Program  # noqa: E402
from toolchain.elf.read import read_executable  # noqa: E402

APPS = ROOT / "firmware" / "apps"
VALUES = {"n": 12, "m": 40, "b": 12, "s": 12, "q": 40, "i": 0, "u": 600, "d": 120, "k": 600, "w": 2}
VALUES |= {"l": 4, "c": 4, "y": 4, "v": 4, "r": 4}
"""Values of annotation names, above those of every application. No stack depends on them."""
RETURN_ADDRESS = 4
SWITCH_LEVEL = 1
"""Level of the interrupts that lead to another thread."""


@dataclass
class Seen:
    """Maxima of one run: bytes by stack, with and without interrupts, and cycles by handler."""

    stacks: dict[str, int] = field(default_factory=dict)
    alone: dict[str, int] = field(default_factory=dict)
    handlers: dict[str, int] = field(default_factory=dict)


@dataclass
class StackRow:
    """One stack (bytes) or handler (cycles) of an application; the bound is None if it is not known."""

    app: str
    name: str
    unit: str
    bound: int | None
    seen: int


@dataclass
class _Stack:
    name: str
    start: int
    end: int
    interrupted: int | None = None
    """W15 at the interrupt that is in progress on the stack, None without one."""


class Observer:
    """Runs an image by single instructions and observes W15."""

    def __init__(self, image: Path, program: Program) -> None:
        self.machine = emu.load(image, engine="plain")
        assert self.machine.run(until="main", seconds=1).reason == "until"
        self.program = program
        self.threads = {entry: program.calls.name(entry).removeprefix("_") for entry in program.threads()}
        self.handlers = {entry: (name, level) for entry, name, level in program.interrupts()}
        self.stacks: list[_Stack] = []
        self.seen = Seen()
        self._open: list[tuple[str, int, int, bool]] = []
        """Handlers in progress: name, W15 at the interrupted instruction, cycle of the start, whether undisturbed."""
        self._begin("main")
        for annotation in program.annotations.of("stack"):
            name, _, text = annotation.text.partition(" ")
            start, size = program.address(name, annotation), program.annotations.number(text, annotation)
            assert start is not None
            assert size is not None
            self.stacks.append(_Stack(SECOND_STACK, start, start + size))

    def run(self, cycles: int) -> Seen:
        """Run for a number of cycles, or until the machine stops, and return the maxima."""
        machine = self.machine
        limit = machine.cycle + cycles
        while machine.cycle < limit:
            before = machine.pc, machine.w[15]
            if machine.service_boundary(NEVER) is not None:
                break
            if machine.pc != before[0] and machine.pc in self.handlers:
                self._enter(before[1])
            self._record()
            if machine.step() is not None:
                break
            self._record()
            if machine.pc in self.threads and machine.pc != before[0]:
                self._begin(self.threads[machine.pc])
            self._leave()
        return self.seen

    def _begin(self, name: str) -> None:
        """Begin the stack of a thread at its first instruction; it replaces those that used the memory before."""
        start, end = self.machine.w[15] - RETURN_ADDRESS, self.machine.peek("SPLIM") + 2
        self.stacks = [one for one in self.stacks if one.end <= start or one.start >= end]
        self.stacks.append(_Stack(name, start, end))

    def _record(self) -> None:
        top = self.machine.w[15]
        stack = self._stack_of(top)
        if stack is None:
            return
        used = top - stack.start
        if used > self.seen.stacks.get(stack.name, -1):
            self.seen.stacks[stack.name] = used
        if stack.interrupted is not None and top <= stack.interrupted:
            stack.interrupted = None
        if stack.interrupted is None and used > self.seen.alone.get(stack.name, -1):
            self.seen.alone[stack.name] = used

    def _stack_of(self, top: int) -> _Stack | None:
        return next((stack for stack in self.stacks if stack.start <= top <= stack.end), None)

    def _enter(self, top: int) -> None:
        self._open = [(name, at, start, False) for name, at, start, _ in self._open]
        stack = self._stack_of(top)
        if stack is not None and stack.interrupted is None:
            stack.interrupted = top
        name, level = self.handlers[self.machine.pc]
        if level > SWITCH_LEVEL:
            self._open.append((name, top, self.machine.cycle, True))

    def _leave(self) -> None:
        while self._open and self.machine.w[15] == self._open[-1][1]:
            name, _, start, counts = self._open.pop()
            if counts:
                self.seen.handlers[name] = max(self.seen.handlers.get(name, 0), self.machine.cycle - start)


def rows_of(app: str, image: Path, cycles: int, values: Mapping[str, int] = VALUES) -> list[StackRow]:
    """Return the rows of one image: every stack, and every handler that occurred."""
    executable = read_executable(image.read_bytes(), str(image))
    program = Program(executable, values)
    report = report_of(program, ["main"])
    seen = Observer(image, program).run(cycles)
    bounds = {row.name: row.cycles for row in report.interrupts}
    rows = [StackRow(app, name, "bytes", bound, seen.stacks.get(name, 0)) for name, bound in report.stacks.items()]
    users = [row for row in report.rows if row.name in report.stacks]
    rows += [
        StackRow(app, f"{user.name} alone", "bytes", RETURN_ADDRESS + user.bytes if user.stack_is_known else None,
            seen.alone.get(user.name, 0))
        for user in users
    ]  # fmt: skip
    return rows + [
        StackRow(app, name, "cycles", bounds[name.removeprefix("_")], most)
        for name, most in sorted(seen.handlers.items())
    ]


def table(rows: list[StackRow]) -> str:
    """Return the table as Markdown, with the median ratio of the stacks."""
    lines = ["| application | stack or handler | bound | measured | unit | ratio |", "|---|---|---|---|---|---|"]
    for row in rows:
        bound, ratio = ("?", "-") if row.bound is None else (f"{row.bound:,}", "-")
        if row.bound is not None and row.seen:
            ratio = f"{row.bound / row.seen:.2f}"
        lines.append(f"| {row.app} | `{row.name}` | {bound} | {row.seen:,} | {row.unit} | {ratio} |")
    ratios = [row.bound / row.seen for row in rows if row.bound is not None and row.seen and row.unit == "bytes"]
    return "\n".join([*lines, "", f"median ratio of stacks: {statistics.median(ratios):.2f}" if ratios else ""])


def main() -> int:
    """Run the command; exit status 1 if a measurement exceeds its bound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--app", action="append", help="only this application (default: all with the kernel)")
    parser.add_argument("--cycles", type=int, default=2_000_000, help="cycles of each run (default 2,000,000)")
    parser.add_argument("--json", action="store_true", help="machine-readable output")
    options = parser.parse_args()
    names = options.app or sorted(path.parent.name for path in APPS.glob("*/main.c"))
    rows: list[StackRow] = []
    with tempfile.TemporaryDirectory(prefix="stacks-") as folder:
        for app in names:
            rows += rows_of(app, build(app, "apps", Path(folder) / app), options.cycles)
            print(f"{app}: {len(rows)} rows", file=sys.stderr)
    print(json.dumps([asdict(row) for row in rows], indent=1) if options.json else table(rows))
    return 1 if any(row.bound is not None and row.seen > row.bound for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
