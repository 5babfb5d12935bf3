"""Measure the speed of instruments as a share of a run without them, in native code.

    python -m bench.emulator.instruments [--seconds S] [--repeat N] [--json]

The program computes in a loop of about 500 Tcy. A hook and conditions are reached once per round, `rounds` changes once
per round, `rare` every 256 rounds. Each run lies between two runs without instruments; the share is the median of N
ratios of host CPU time. Instruments that call Python often or write much text run a shorter time.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import emu
from emu.dap.breakpoints import Breakpoint
from emu.dap.debuggee import Debuggee
from emu.debug.history import History
from emu.dspic30f.cycle_accounting import CycleAccounting
from emu.dspic30f.jit.counting import CycleCounting
from emu.dspic30f.jit.engine import JitEngine
from emu.instruments.coverage import Counts, count_executions
from emu.instruments.trace import Tracer
from emu.instruments.vcd import WaveformRecorder

ROOT = Path(__file__).resolve().parents[2]
SOURCE = """
#define TIMER_CONTROL (*(volatile unsigned *)0x0104)
volatile unsigned rounds, rare; volatile long total; static int table[16];
void __attribute__((noinline)) mark(void) { if ((++rounds & 255) == 0) rare++; }
void __attribute__((noinline)) inner(int i) { table[i & 15] += i; total += table[i & 7] ^ i; }
int main(void) {
    TIMER_CONTROL = 0x8000;
    for (;;) {
        mark();
        for (int i = 0; i < 18; i++) inner(i);
    }
}
"""

Run = Callable[[emu.Machine, int], object]


def hook(place: str) -> Run:
    """Return a run with a hook in Python that does nothing."""

    def run(machine: emu.Machine, cycles: int) -> None:
        remove = machine.hook_pc(place, lambda: None)
        machine.run(cycles=cycles)
        remove()

    return run


def arrivals(place: str, log: bool = True) -> Run:
    """Return a run that counts arrivals at a place and, with `log`, logs their cycles and a number."""

    def run(machine: emu.Machine, cycles: int) -> None:
        with emu.Arrivals(machine, place, values=["rounds"], log=log):
            machine.run(cycles=cycles)

    return run


def breakpoint_if(condition: str) -> Run:
    """Return a run with a conditional breakpoint of the debugger, whose condition never holds."""

    def run(machine: emu.Machine, cycles: int) -> None:
        target = Debuggee(machine, lambda: False, lambda _text: None, History(machine))
        address = machine.program_address("mark")
        target.set_breakpoints("here", [Breakpoint(1, "function", (address,), condition=condition)])
        target.goto(machine.cycle + cycles)
        target.release()

    return run


def watch(place: str, pause: bool = True) -> Run:
    """Return a run with `emu.watch`, which pauses at every change or collects the changes in Python."""

    def run(machine: emu.Machine, cycles: int) -> None:
        address = machine.value(place).address or 0
        for _ in emu.watch(machine, address, cycles=cycles, pause=pause):
            pass

    return run


def waveform(*names: str) -> Run:
    """Return a run with a waveform of the named values."""

    def run(machine: emu.Machine, cycles: int) -> None:
        recorder = WaveformRecorder(machine, io.StringIO(), names)
        recorder.advance(machine.cycle + cycles)
        recorder.close()

    return run


def trace(machine: emu.Machine, cycles: int) -> None:
    """Run with an instruction trace."""
    assert machine.image is not None
    with open(os.devnull, "w", encoding="utf-8") as stream:
        tracer = Tracer(machine, machine.image, stream)
        tracer.advance(machine.cycle + cycles)
        tracer.close()


def coverage(machine: emu.Machine, cycles: int) -> None:
    """Run with execution counts."""
    stop = count_executions(machine, Counts())
    machine.run(cycles=cycles)
    stop()


def profile(machine: emu.Machine, cycles: int) -> None:
    """Run with cycle accounting by instruction, without a call graph."""
    assert isinstance(machine.runner, JitEngine)
    stop = machine.runner.start_counting(CycleCounting(CycleAccounting(machine.core), lambda pc: pc))
    machine.run(cycles=cycles)
    stop()


RUNS: dict[str, tuple[Run, float]] = {
    "none": (lambda machine, cycles: machine.run(cycles=cycles), 1),
    "profile": (profile, 1),
    "coverage": (coverage, 1),
    "hook in Python, every 500 Tcy": (hook("mark"), 0.05),
    "hook in Python, inner loop": (hook("inner"), 0.01),
    "arrivals counted, every 500 Tcy": (arrivals("mark", log=False), 1),
    "arrivals counted, inner loop": (arrivals("inner", log=False), 1),
    "arrivals logged, every 500 Tcy": (arrivals("mark"), 1),
    "arrivals logged, inner loop": (arrivals("inner"), 0.2),
    "break if, global": (breakpoint_if("rounds == 1"), 1),
    "break if, SFR and register": (breakpoint_if("TMR1 > 5 && W15 > 0x8000"), 1),
    "until at a place": (lambda machine, cycles: machine.run(cycles=cycles, until="mark", when="rare == 65535"), 1),
    "until a condition": (lambda machine, cycles: machine.run(cycles=cycles, until="rare > 60000"), 1),
    "until a function": (lambda machine, cycles: machine.run(cycles=cycles, until=lambda: False), 0.001),
    "watch, changes every 128,000 Tcy": (watch("rare"), 1),
    "watch, changes every 500 Tcy": (watch("rounds"), 0.01),
    "watch without pauses, every 500 Tcy": (watch("rounds", pause=False), 1),
    "vcd, changes every 128,000 Tcy": (waveform("rare", "ipl"), 1),
    "vcd, changes every 500 Tcy": (waveform("rounds"), 1),
    "trace": (trace, 0.1),
}
"""Runs by the name of the instrument, each with its share of the simulated time."""


def machine_of(image: Path) -> emu.Machine:
    machine = emu.load(image, engine="jit", board=None)
    assert isinstance(machine.runner, JitEngine)
    machine.runner.wait = True
    machine.run(cycles=200_000)
    return machine


def speed(image: Path, name: str, seconds: float) -> float:
    """Return simulated seconds per second of CPU of one run with an instrument."""
    run, share = RUNS[name]
    machine = machine_of(image)
    cycles = int(machine.hz * seconds * share)
    run(machine, cycles // 100)
    begun = time.process_time()
    run(machine, cycles)
    return cycles / float(machine.hz) / (time.process_time() - begun)


def measure(image: Path, seconds: float, repeat: int) -> tuple[dict[str, float], dict[str, float]]:
    """Return medians by instrument: simulated seconds per CPU second, and as a share of plain runs before and after."""
    speeds: dict[str, list[float]] = {name: [] for name in RUNS}
    shares: dict[str, list[float]] = {name: [] for name in RUNS}
    for _ in range(repeat):
        for name in RUNS:
            before, one, after = (speed(image, kind, seconds) for kind in ("none", name, "none"))
            speeds[name].append(one)
            shares[name].append(2 * one / (before + after))
    return {name: median(found) for name, found in speeds.items()}, {k: median(found) for k, found in shares.items()}


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
        found, shares = measure(image, options.seconds, options.repeat)
    if options.json:
        print(json.dumps({"real time": found, "share": shares}))
        return
    for name, one in found.items():
        print(f"{name:36} {one:9.3f} x real time  {shares[name]:8.4f}")


if __name__ == "__main__":
    main()
