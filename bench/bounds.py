"""Bounds of our kernel's calls beside the worst that runs of its applications take: one table.

`python -m bench.bounds [--image NAME] [--times X] [--json]`. Each call is bounded in the image it is measured in, with
as many threads, events, subscriptions, messages and holes as there were at most while its longest was under way (--json
tells them). Measured is from the first instruction to behind the return, as bounds are; a call that was interrupted, or
in which threads were switched, is not counted; a thread that ends itself goes on into the scheduler, so of its end
`end_thread` has a row and `Sys_Kill_Process` is that of others. "Plain" leaves out the ways on which memory is short,
the reserve is exchanged, a handler has left something to join, or the call is refused; they count in the other column.
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

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import emu  # noqa: E402
from bench.structures import Structures  # noqa: E402
from toolchain.bounds.annotations.reader import read_annotation_section  # noqa: E402
from toolchain.bounds.program import Program  # noqa: E402
from toolchain.bounds.report import BoundAnalysis  # noqa: E402
from toolchain.elf.read import read_executable  # noqa: E402
from toolchain.stack.annotations import Annotations, add_symbols  # noqa: E402

APART = ("refuse_message", "os_fail", "os_refuse")
"""Functions of the ways that are not plain."""
PLAIN = {"x": 0, "j": 0}
"""Limits of plain ways beside those seen: no hole outgrows the reserve, nothing given back waits to be joined."""
ITSELF = "os_thread_returned"
"""Where a thread ends itself: on into the scheduler, a row of its own."""
TREE = ("find_hole", "remove_hole", "insert_hole")
"""What works on the heap's tree: in front of each it is whole."""
EXCHANGE = "swap_reserve"
"""Pulls a hole only where it is larger than the reserve."""
ALSO = ("_end_thread",)
"""Timed beside the calls."""
SWITCHES = ("hal_yield", "hal_block", "hal_abandon")
TARGET = "../tests/firmware/target"
IMAGES = {
    "stress": ("apps", 2.0, {"i": 0, "u": 100, "d": 24, "k": 384}),
    "points": (TARGET, 2.0, {"i": 0, "u": 100, "d": 24, "k": 192}),
    "crowded": (TARGET, 0.15, {"i": 0, "u": 60, "d": 2, "k": 400}),
}
"""Images, where they are, seconds in which they do everything, and limits that are not counted (bounds --help)."""
ROUND, NEWEST, LAST = "numbers_are_round", "newest_pid", 0xFFFF
"""Where an image has this function, the last number of threads has just been given; to start so many takes too long."""
CALL_BYTES = 4


@dataclass
class Row:
    """One call in one image: cycles of its longest and of its bound, None where it has none, or never came undisturbed;
    the most there was of everything during the longest."""

    image: str
    call: str
    seen: int | None = None
    bound: int | None = None
    plain_seen: int | None = None
    plain_bound: int | None = None
    limits: dict[str, int] = field(default_factory=dict)
    plain_limits: dict[str, int] = field(default_factory=dict)


@dataclass
class Open:
    """A call under way: where its stack and clock stood, and whether it still counts, and as plain."""

    name: str
    top: int
    start: int
    counts: bool = True
    plain: bool = True
    most: dict[str, int] = field(default_factory=dict)


def _cycles(longest: tuple[int, dict[str, int]]) -> int:
    return longest[0]


def _merge(into: dict[str, int], found: dict[str, int]) -> None:
    """The larger of each."""
    for name, number in found.items():
        into[name] = max(into.get(name, 0), number)


@dataclass
class Meter:
    """Times calls on a running machine, and counts the most there is of everything while each is under way."""

    machine: emu.Machine
    structures: Structures
    worst: dict[tuple[str, bool], tuple[int, dict[str, int]]] = field(default_factory=dict)
    """Of a call, plain or not: cycles of its longest, and the most of everything meanwhile."""
    under_way: list[Open] = field(default_factory=list)
    watched: set[int] = field(default_factory=set)

    def enter(self, name: str) -> Callable[[], bool]:
        """What happens at the first instruction of a function."""

        def hook() -> bool:
            machine = self.machine
            top = machine.w[15]
            back = machine.peek(top - 4) | (machine.peek(top - 2) & 0x7F) << 16
            self.under_way.append(Open(name, top - CALL_BYTES, machine.cycle))
            self.look()
            if back not in self.watched:
                self.watched.add(back)
                machine.hook_pc(back, self.leave)
            return False

        return hook

    def leave(self) -> bool:
        """Where some call came from."""
        top = self.machine.w[15]
        ended = [one for one in self.under_way if one.top == top]
        if ended:
            self.look()
        for one in ended:
            self.under_way.remove(one)
            if one.counts:
                key, cycles = (one.name, one.plain), self.machine.cycle - one.start
                if cycles > self.worst.get(key, (0, {}))[0]:
                    self.worst[key] = cycles, one.most
        return False

    def look(self) -> None:
        """Count everything, for all calls under way."""
        found = self.structures.look()
        for one in self.under_way:
            _merge(one.most, found)

    def turn_round(self) -> bool:
        """Where numbers of threads begin again."""
        self.machine.poke(NEWEST, LAST)
        return False

    def tree(self, exchange: range) -> Callable[[], bool]:
        """What happens in front of a step on the tree, and where it was called from one that is not plain."""

        def hook() -> bool:
            top = self.machine.w[15]
            self.look()
            if (self.machine.peek(top - 4) & ~1) in exchange:
                self.apart()
            return False

        return hook

    def disturb(self) -> bool:
        """An interrupt, or a switch."""
        for one in self.under_way:
            one.counts = False
        return False

    def apart(self) -> bool:
        """A way that is not plain."""
        for one in self.under_way:
            one.plain = False
        return False


def build(app: str, apps: str, out: Path) -> Path:
    """The image of an application."""
    words = [f"APP={app}", f"APPS={apps}", f"OUT={out}", f"PYTHON={sys.executable}"]
    subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), *words], check=True)
    return out / "firmware.elf"


def measure(path: Path, program: Program, names: list[str], seconds: float) -> Meter:
    """The worst of each function, plain and otherwise, and the most of everything there was meanwhile."""
    machine = emu.load(path)
    meter = Meter(machine, Structures(machine))
    for handler, _, _ in program.interrupts():
        machine.hook_pc(handler, meter.disturb)
    for hooked, hook in ((SWITCHES, meter.disturb), (APART, meter.apart)):
        for name in hooked:
            address = program.address(name)
            if address in program.calls.entries:
                machine.hook_pc(address, hook)
    if program.address(ROUND) in program.calls.entries:
        machine.hook_pc(ROUND, meter.turn_round)
    exchange = _extent(program, EXCHANGE)
    for name in TREE:
        address = program.address(name)
        if address in program.calls.entries:
            machine.hook_pc(address, meter.tree(exchange if name == "remove_hole" else range(0)))
    for name in names:
        address = program.address(name)
        assert address is not None
        machine.hook_pc(address, meter.enter(name))
    machine.run(seconds=seconds)
    return meter


def _extent(program: Program, name: str) -> range:
    """Addresses of a function, up to the next."""
    start = program.address(name)
    if start not in program.calls.entries or start is None:
        return range(0)
    return range(start, min(entry for entry in program.calls.entries if entry > start))


def rows_of(app: str, path: Path, values: dict[str, int], seconds: float) -> list[Row]:
    """All calls of the kernel in one image."""
    image = read_executable(path.read_bytes(), str(path))
    annotations = Annotations()
    add_symbols(annotations, image.symbols)
    bare = Program(image, annotations, read_annotation_section(image, values))
    names = [*bare.interesting("_Sys_"), *(name for name in ALSO if bare.address(name) in bare.calls.entries)]
    meter = measure(path, bare, names, seconds)
    seen = meter.worst
    there = [name for name in (ITSELF, *APART) if bare.address(name) in bare.calls.entries]
    itself = [name for name in there if name == ITSELF]

    def bound(name: str, limits: dict[str, int], left_out: list[str]) -> int | None:
        program = Program(image, annotations, read_annotation_section(image, values | limits), left_out)
        at = program.address(name)
        assert at is not None
        return BoundAnalysis(program).bound(name, at, "call").cycles

    rows = []
    for name in names:
        row = Row(app, name.lstrip("_"))
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


def table(rows: list[Row]) -> str:
    """As Markdown."""

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
    """Command line; status 1 if anything was seen above its bound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=float, default=1.0, help="run each image that many times as long (default 1)")
    parser.add_argument("--image", action="append", choices=IMAGES, help="only this one (default: all)")
    parser.add_argument("--json", action="store_true", help="machine-readable output")
    options = parser.parse_args()
    rows: list[Row] = []
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
