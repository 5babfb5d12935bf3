"""Compare bounds of kernel calls with the longest observed runs: one table.

    python -m bench.kernel.bounds [--image NAME] [--times X] [--json]

Each call is bounded and measured in the same image. The bound assumes the maximum numbers of threads, events,
subscriptions, messages and holes during the longest run of that call; --json lists them. A run is measured like a
bound, from the first instruction to the one after the return. Runs with an interrupt or a thread switch do not count. A
thread that ends itself does not return but continues in the scheduler: `end_thread` has a row for that case, and the
row of `Sys_Kill_Process` is for other threads. The column "plain" excludes paths on which memory is short, the reserve
is swapped, a free run of a handler is pending, or the call is refused; the other column includes them.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import emu
from bench.kernel.structures import Structures
from toolchain.bounds.program import Program
from toolchain.bounds.report import BoundAnalysis
from toolchain.elf.read import read_executable

ROOT = Path(__file__).resolve().parents[2]
EXCLUDED = ("refuse_message", "os_fail", "os_refuse")
"""Functions that are called only on paths excluded from the column "plain"."""
PLAIN = {"x": 0, "j": 0}
"""Additional limits of plain paths: no hole is larger than the reserve, and no free run is pending."""
THREAD_END = "os_thread_returned"
"""Function through which a thread ends itself and continues in the scheduler; this path has its own row."""
TREE_FUNCTIONS = ("find_hole", "remove_hole", "insert_hole")
"""Functions that change the heap's tree; the tree is consistent at the entry of each."""
RESERVE_SWAP = "swap_reserve"
"""Function that removes a hole only if it is larger than the reserve."""
ALSO_TIMED = ("_end_thread",)
"""Functions that are timed although they are not kernel calls."""
SWITCHES = ("hal_yield", "hal_block", "hal_abandon")
TARGET = "../tests/firmware/target"
IMAGES = {
    "stress": ("apps", 2.0, {"i": 0, "u": 100, "d": 24, "k": 384}),
    "points": (TARGET, 2.0, {"i": 0, "u": 100, "d": 24, "k": 192}),
    "crowded": (TARGET, 0.15, {"i": 0, "u": 60, "d": 2, "k": 400}),
}
"""Folder of each image, simulated seconds until it has made every call, and values of annotation names that cannot be
measured (`toolchain bounds --let`)."""
ROUND, NEWEST, LAST = "numbers_are_round", "newest_pid", 0xFFFE
"""An image with the function `numbers_are_round` starts with the last PID already assigned, because starting that
many threads would take too long."""
CALL_BYTES = 4


@dataclass
class BoundsRow:
    """One call in one image: cycles of its longest run and of its bound, and the maximum sizes of all structures
    during that run. Values are None if the call is absent or always disturbed."""

    image: str
    call: str
    seen: int | None = None
    bound: int | None = None
    plain_seen: int | None = None
    plain_bound: int | None = None
    limits: dict[str, int] = field(default_factory=dict)
    plain_limits: dict[str, int] = field(default_factory=dict)


@dataclass
class OpenCall:
    """A call in progress: stack pointer and cycle at its start, whether it counts, and whether its path is plain."""

    name: str
    top: int
    start: int
    counts: bool = True
    plain: bool = True
    most: dict[str, int] = field(default_factory=dict)


def _cycles(longest: tuple[int, dict[str, int]]) -> int:
    return longest[0]


def _merge(into: dict[str, int], found: dict[str, int]) -> None:
    """Set each element of the first mapping to the maximum of both mappings."""
    for name, number in found.items():
        into[name] = max(into.get(name, 0), number)


@dataclass
class CallMeter:
    """Timer of calls on a running machine, which also records the maxima of all structures during each call."""

    machine: emu.Machine
    structures: Structures
    worst: dict[tuple[str, bool], tuple[int, dict[str, int]]] = field(default_factory=dict)
    """Cycles of the longest run and the maxima during it, by (function, whether its path is plain)."""
    open_calls: list[OpenCall] = field(default_factory=list)
    watched: set[int] = field(default_factory=set)

    def entry_hook(self, name: str) -> Callable[[], bool]:
        """Return the hook for the first instruction of a function."""

        def hook() -> bool:
            machine = self.machine
            top = machine.w[15]
            back = machine.peek(top - 4) | (machine.peek(top - 2) & 0x7F) << 16
            self.open_calls.append(OpenCall(name, top - CALL_BYTES, machine.cycle))
            self.record_sizes()
            if back not in self.watched:
                self.watched.add(back)
                machine.hook_pc(back, self.leave)
            return False

        return hook

    def leave(self) -> bool:
        """Record the duration of the calls that return to this address; hook of that address."""
        top = self.machine.w[15]
        ended = [one for one in self.open_calls if one.top == top]
        if ended:
            self.record_sizes()
        for one in ended:
            self.open_calls.remove(one)
            if one.counts:
                key, cycles = (one.name, one.plain), self.machine.cycle - one.start
                if cycles > self.worst.get(key, (0, {}))[0]:
                    self.worst[key] = cycles, one.most
        return False

    def record_sizes(self) -> None:
        """Record the sizes of all structures for all calls in progress."""
        found = self.structures.sizes()
        for one in self.open_calls:
            _merge(one.most, found)

    def set_newest_pid(self) -> bool:
        """Make the greatest PID the newest one, so that the next PIDs wrap around. A hook: False continues the run."""
        self.machine.poke(NEWEST, LAST)
        return False

    def tree_change_hook(self, exchange: range) -> Callable[[], bool]:
        """Return a hook for the entry of a function that changes the heap's tree of holes. `exchange` is the address
        range of the function that swaps the reserve; a call that reaches the hook from there is not plain."""

        def hook() -> bool:
            top = self.machine.w[15]
            self.record_sizes()
            if (self.machine.peek(top - 4) & ~1) in exchange:
                self.mark_not_plain()
            return False

        return hook

    def discard_calls(self) -> bool:
        """Discard the calls in progress, which an interrupt or a thread switch disturbs. A hook."""
        for one in self.open_calls:
            one.counts = False
        return False

    def mark_not_plain(self) -> bool:
        """Mark the calls in progress as not plain. A hook."""
        for one in self.open_calls:
            one.plain = False
        return False


def build(app: str, apps: str, out: Path) -> Path:
    """Build and return the image of an application."""
    words = [f"APP={app}", f"APPS={apps}", f"OUT={out}", f"PYTHON={sys.executable}"]
    subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), *words], check=True)
    return out / "firmware.elf"


def measure(path: Path, program: Program, names: list[str], seconds: float) -> CallMeter:
    """Return the longest run of each function, plain and not, and the maxima of all structures during it."""
    machine = emu.load(path)
    meter = CallMeter(machine, Structures(machine))
    for handler, _, _ in program.interrupts():
        machine.hook_pc(handler, meter.discard_calls)
    for hooked, hook in ((SWITCHES, meter.discard_calls), (EXCLUDED, meter.mark_not_plain)):
        for name in hooked:
            address = program.address(name)
            if address in program.calls.entries:
                machine.hook_pc(address, hook)
    if program.address(ROUND) in program.calls.entries:
        machine.hook_pc(ROUND, meter.set_newest_pid)
    exchange = _extent(program, RESERVE_SWAP)
    for name in TREE_FUNCTIONS:
        address = program.address(name)
        if address in program.calls.entries:
            machine.hook_pc(address, meter.tree_change_hook(exchange if name == "remove_hole" else range(0)))
    for name in names:
        address = program.address(name)
        assert address is not None
        machine.hook_pc(address, meter.entry_hook(name))
    machine.run(seconds=seconds)
    return meter


def _extent(program: Program, name: str) -> range:
    """Return the addresses of a function, up to the next one."""
    start = program.address(name)
    if start not in program.calls.entries or start is None:
        return range(0)
    return range(start, min(entry for entry in program.calls.entries if entry > start))


def rows_of(app: str, path: Path, values: dict[str, int], seconds: float) -> list[BoundsRow]:
    """Return the rows of all kernel calls in one image."""
    image = read_executable(path.read_bytes(), str(path))
    bare = Program(image, values)
    also = [name for name in ALSO_TIMED if bare.address(name) in bare.calls.entries]
    names = [*bare.default_functions("_Sys_"), *also]
    meter = measure(path, bare, names, seconds)
    seen = meter.worst
    there = [name for name in (THREAD_END, *EXCLUDED) if bare.address(name) in bare.calls.entries]
    itself = [name for name in there if name == THREAD_END]

    def bound(name: str, limits: dict[str, int], left_out: list[str]) -> int | None:
        program = Program(image, values | limits, left_out)
        at = program.address(name)
        assert at is not None
        return BoundAnalysis(program).bound(name, at, "call").cycles

    rows = []
    for name in names:
        row = BoundsRow(app, name.lstrip("_"))
        plain = seen.get((name, True))
        longest = max((seen[name, kind] for kind in (True, False) if (name, kind) in seen), key=_cycles, default=None)
        if longest is not None:
            row.seen, row.limits = longest
            row.bound = bound(name, row.limits, itself)
            rows.append(row)
        if plain is not None:
            row.plain_seen, row.plain_limits = plain
            row.plain_bound = bound(name, row.plain_limits | PLAIN, there)
    return rows


def table(rows: list[BoundsRow]) -> str:
    """Return the table as Markdown."""

    def ratio(bound: int | None, seen: int | None) -> str:
        return "-" if bound is None or not seen else f"{bound / seen:.2f}"

    def number(value: int | None) -> str:
        return "-" if value is None else f"{value:,}"

    lines = [
        "| image | call | plain: bound | seen | ratio | all: bound | seen | ratio |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = [row.image, f"`{row.call}`", number(row.plain_bound), number(row.plain_seen)]
        cells += [
            ratio(row.plain_bound, row.plain_seen),
            number(row.bound),
            number(row.seen),
            ratio(row.bound, row.seen),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> int:
    """Run the command; exit status 1 if a run exceeds its bound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=float, default=1.0, help="run each image that many times as long (default 1)")
    parser.add_argument("--image", action="append", choices=IMAGES, help="only this one (default: all)")
    parser.add_argument("--json", action="store_true", help="machine-readable output")
    options = parser.parse_args()
    rows: list[BoundsRow] = []
    with tempfile.TemporaryDirectory(prefix="bounds-") as folder:
        for app in options.image or IMAGES:
            apps, seconds, values = IMAGES[app]
            path = build(app, apps, Path(folder) / app)
            rows += rows_of(app, path, values, seconds * options.times)
    print(json.dumps([asdict(row) for row in rows], indent=1) if options.json else table(rows))
    over = [r for r in rows for b, s in ((r.bound, r.seen), (r.plain_bound, r.plain_seen)) if b and s and s > b]
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
