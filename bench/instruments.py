"""Measure the speed of instruments as a share of a run without them, in native code.

    python bench/instruments.py [--seconds S] [--repeat N] [--json]

Instruments: coverage, a hook and a conditional breakpoint that are reached every 500 Tcy, `until=` with a condition,
`emu.watch`, and a trace. The program computes in a loop of about 500 Tcy (bench/c/compute.c has longer ones). The
figure is the minimum host CPU time of N runs; the kinds alternate. Slow instruments run a shorter time.
"""

from __future__ import annotations

import argparse
import io
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import emu  # noqa: E402
from emu.debug.expressions.filters import filter_of  # noqa: E402
from emu.dspic30f.jit.engine import JitEngine  # noqa: E402
from emu.instruments.coverage import Counts, count_executions  # noqa: E402
from emu.instruments.trace import Tracer  # noqa: E402

SOURCE = """
volatile unsigned rounds; volatile long total; static int table[16];
void __attribute__((noinline)) mark(void) { rounds++; }
int main(void) {
    for (;;) {
        mark();
        for (int i = 0; i < 30; i++) { table[i & 15] += i; total += table[i & 7] ^ i; }
    }
}
"""
SHORT = 0.01
"""Share of the simulated time for instruments that run in single steps."""

Run = Callable[[emu.Machine, int], None]


def plain(machine: emu.Machine, cycles: int) -> None:
    machine.run(cycles=cycles)


def hook(machine: emu.Machine, cycles: int) -> None:
    remove = machine.hook_pc("mark", lambda: None)
    machine.run(cycles=cycles)
    remove()


def conditional(machine: emu.Machine, cycles: int) -> None:
    asked: Callable[[], bool] = lambda: machine.peek("rounds") == 1  # noqa: E731
    remove = machine.hook_pc(
        "mark", asked, filter_of(machine.inspector, "rounds == 1", machine.program_address("mark"))
    )
    machine.run(cycles=cycles)
    remove()


def until(machine: emu.Machine, cycles: int) -> None:
    machine.run(cycles=cycles, until=lambda: False)


def watch(machine: emu.Machine, cycles: int) -> None:
    for _ in emu.watch(machine, "rounds", cycles=cycles):
        pass


def trace(machine: emu.Machine, cycles: int) -> None:
    assert machine.image is not None
    Tracer(machine, machine.image, io.StringIO()).advance(machine.cycle + cycles)


RUNS: dict[str, tuple[Run, float]] = {
    "none": (plain, 1), "hook every 500 Tcy": (hook, 1), "conditional breakpoint": (conditional, 1),
    "until= a condition": (until, SHORT),
    "watch": (watch, SHORT), "trace": (trace, SHORT),
}  # fmt: skip


def machine_of(image: Path) -> emu.Machine:
    machine = emu.load(image, engine="jit", board=None)
    assert isinstance(machine.runner, JitEngine)
    machine.runner.wait = True
    machine.run(cycles=200_000)
    return machine


def measure(image: Path, seconds: float, repeat: int) -> dict[str, float]:
    """Return simulated seconds per second of CPU, by instrument."""
    best: dict[str, float] = {}
    for _ in range(repeat):
        for name, (run, share) in RUNS.items():
            machine = machine_of(image)
            cycles = int(machine.hz * seconds * share)
            run(machine, cycles // 100)
            begun = time.process_time()
            run(machine, cycles)
            best[name] = max(best.get(name, 0), cycles / float(machine.hz) / (time.process_time() - begun))
        machine, counts = machine_of(image), Counts()
        stop = count_executions(machine, counts)
        cycles = int(machine.hz * seconds)
        machine.run(cycles=cycles // 100)
        begun = time.process_time()
        machine.run(cycles=cycles)
        best["coverage"] = max(best.get("coverage", 0), seconds / (time.process_time() - begun))
        stop()
    return best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20, metavar="S", help="simulated time (default 20)")
    parser.add_argument("--repeat", type=int, default=3, metavar="N", help="runs of each kind (default 3)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        source, image = Path(folder) / "p.c", Path(folder) / "p.elf"
        source.write_text(SOURCE, encoding="utf-8")
        emu.build(source, output=image)
        found = measure(image, options.seconds, options.repeat)
    shares = {name: speed / found["none"] for name, speed in found.items()}
    if options.json:
        print(json.dumps({"real time": found, "share": shares}))
        return
    for name, speed in found.items():
        print(f"{name:22} {speed:9.2f} x real time  {shares[name]:8.4f}")


if __name__ == "__main__":
    main()
