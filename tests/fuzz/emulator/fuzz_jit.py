"""Compare native code with the interpreters on random code, with interrupts and stops at random cycles.

Three kinds of programs run until their targets are reached:
- `straight`: thousands of distinct instructions per program, compared with the plain interpreter; each program also
  runs in exact code alone;
- `wild`: jumps, traps and mode changes at random places; odd seeds use a fictitious chip;
- `long`: loops of millions of instructions, block code compared with exact code, and a share of it also with the plain
  interpreter.

Odd seeds run with ipl_slip 1. With --seconds the targets are unlimited, and the campaign ends after that time.

    python tests/fuzz/emulator/fuzz_jit.py                                           # a few minutes
    python tests/fuzz/emulator/fuzz_jit.py --pairs 1000000 --interrupts 100000 --instructions 1000000000 --wild 2000 \
        --state jit.npz                                             # whole campaign; can be interrupted and resumed

Exits with 1 at the first difference, which is reported with campaign and seed, and with 130 after Ctrl-C, with the
results so far.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from emu.chips.dspic30f6014a import DSPIC30F6014A  # noqa: E402
from tests.emu.chips.made_up import MADE_UP  # noqa: E402
from tests.emu.jit.comparison.engine_pair import Difference, Tally, check_straight, check_wild  # noqa: E402
from tests.emu.jit.comparison.long_runs import check_long  # noqa: E402
from tests.fuzz.seeds import base_seed  # noqa: E402

SAVE_EVERY = 60.0
"""Seconds between two writes of the state file."""
LONG = 10_000_000
"""Number of instructions per program of the campaign `long`."""


CHECKS: dict[str, Callable[[int], Tally]] = {
    "straight": check_straight,
    "wild": lambda seed: check_wild(seed, chip=(DSPIC30F6014A, MADE_UP)[seed % 2]),
    "long": lambda seed: check_long(seed, LONG),
}


class Campaign:
    """Tallies and the next seed of each kind of program, stored in a file if one is given."""

    def __init__(self, seed: int, file: Path | None) -> None:
        self.tally = Tally()
        self.seeds = dict.fromkeys(("straight", "wild", "long"), seed)
        self.seconds = 0.0
        self._file = file
        self._saved = time.monotonic()
        if file is not None and file.exists():
            with np.load(file) as kept:
                counts = json.loads(str(kept["counts"]))
                self.tally.unpack(counts, {name: kept[name].tobytes() for name in ("seen", "native", "both")})
            self.seeds, self.seconds = counts["seeds"], counts["seconds"]

    def save(self) -> None:
        """Write the state by atomic rename."""
        if self._file is None:
            return
        sets = {name: np.frombuffer(data, np.uint64) for name, data in self.tally.packed().items()}
        part = self._file.with_suffix(".part.npz")
        np.savez(part, counts=json.dumps(self.report()), **sets)
        os.replace(part, self._file)
        self._saved = time.monotonic()

    def report(self) -> dict[str, Any]:
        """Return all counts."""
        return self.tally.as_json() | {"seeds": self.seeds, "seconds": round(self.seconds, 1)}

    def run(self, kind: str, check: Callable[[int], Tally]) -> None:
        """Run one program of a kind. Raises Difference."""
        seed, start = self.seeds[kind], time.process_time()
        try:
            found = check(seed)
        except Difference as difference:
            again = f"python tests/fuzz/emulator/fuzz_jit.py --kind {kind} --seed {seed}"
            raise Difference(f"{kind} seed {seed}: {difference}\nagain: {again}") from difference
        self.tally.add(found)
        self.seeds[kind] = seed + 1
        self.seconds += time.process_time() - start
        if time.monotonic() - self._saved > SAVE_EVERY:
            self.save()


def campaign(state: Campaign, options: argparse.Namespace, progress: Progress) -> None:
    """Run until every target is met, always with the kind of program that is furthest from its target."""
    tally, start = state.tally, time.monotonic()
    goals: dict[str, tuple[int, Callable[[], int]]] = {
        "native pairs": (options.pairs, lambda: len(tally.native)),
        "interrupts": (options.interrupts, lambda: tally.places["interrupts"]),
        "wild programs": (options.wild, lambda: tally.programs["wild"]),
        "instructions": (options.instructions, tally.executed),
    }
    tasks = {name: progress.add_task(name, total=total) for name, (total, _done) in goals.items()}
    if options.kind is not None:
        state.run(options.kind, CHECKS[options.kind])
        return
    while True:
        shares = {name: done() / total for name, (total, done) in goals.items() if total}
        for name, task in tasks.items():
            progress.update(task, completed=goals[name][1]())
        behind = min(shares, key=shares.__getitem__)
        if options.seconds is None and shares[behind] >= 1:
            return
        if options.seconds is not None and time.monotonic() - start >= options.seconds:
            return
        kind = {"instructions": "long", "wild programs": "wild"}.get(behind, "straight")
        state.run(kind, CHECKS[kind])


def text_of(report: dict[str, Any]) -> str:
    """Return the tally as readable text."""
    rows, native = report["rows"], report["native_rows"]
    rarest = sorted(rows.items(), key=lambda item: item[1])[:3]
    never = sorted(set(rows) - set(native), key=lambda name: int(name.split()[0]))
    programs = ", ".join(f"{count} {name}" for name, count in report["programs"].items())
    places = "\n".join(f"    {count:9} {name}" for name, count in sorted(report["places"].items(), key=lambda i: -i[1]))
    rare = ", ".join(f"{name}: {count}" for name, count in rarest)
    return (
        f"{programs} programs, {report['executed']} instructions, {report['stops']} stops "
        f"({report['exchanges']} with snapshots "
        f"exchanged), {sum(report['entries'].values())} exceptions: no difference, {report['seconds']:.0f} s\n"
        f"(word, modes) pairs: {report['pairs']}, natively {report['native_pairs']}, in exact code once more "
        f"{report['exact_pairs']}\n{len(rows)} rows, the rarest {rare}\n"
        f"rows never native: {', '.join(never) or 'none'}\nexceptions entered in step, by place:\n{places}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=50_000, help="distinct native pairs (default %(default)s)")
    parser.add_argument("--interrupts", type=int, default=4_000, help="interrupts in step (default %(default)s)")
    parser.add_argument("--wild", type=int, default=100, help="wild programs (default %(default)s)")
    parser.add_argument("--instructions", type=int, default=40_000_000, help="in all (default %(default)s)")
    parser.add_argument("--seed", type=int, default=base_seed(), help="first of each kind (default: from the commit)")
    parser.add_argument("--seconds", type=float, help="begin no new program after S seconds", metavar="S")
    parser.add_argument("--kind", choices=CHECKS, help="only the program of this kind and seed")
    parser.add_argument("--state", type=Path, help="file that keeps the tallies, to resume from")
    parser.add_argument("--json", action="store_true", help="print the tallies as JSON")
    options = parser.parse_args()
    state, status = Campaign(options.seed, options.state), 0
    columns = (TextColumn("{task.description:>14}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty()) as progress:
        try:
            campaign(state, options, progress)
        except Difference as difference:
            print(f"FAILED at {difference}")
            status = 1
        except KeyboardInterrupt:
            status = 130
    state.save()
    report = state.report()
    print(json.dumps(report) if options.json else text_of(report))
    return status


if __name__ == "__main__":
    sys.exit(main())
