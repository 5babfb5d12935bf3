"""Measure the overhead of `emu profile` over a plain run of the same image in native code.

    python -m bench.emulator.profiling [--seconds S] [--repeat N] [--only WORD] [--json]

The figure of each kind of run is the minimum host CPU time of N runs; the kinds alternate. All native code is compiled
before the timing starts. Images: computing C, many calls, and interrupts every 100 and every 10 us (bench/c), each at
-Os and at -O0; the kernel with busy threads (firmware/apps/compute), the paper's Listing 1, and the clustering robot
with its camera on. --timed also records events in order, as for --speedscope and --perfetto. With --cold each run is a
process of its own.
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np

import emu
from emu.boards.epuck.board import Epuck
from emu.dspic30f.jit.engine import JitEngine
from emu.profile.cycle_shares import Profiler

ROOT = Path(__file__).resolve().parents[2]
MIPS = 14_745_600  # instruction cycles per second of an e-puck (engines.md §4.2)


SOURCES = {
    "computing C": ("compute.c", "-DROUNDS=65535"),
    "calls": ("calls.c",),
    "interrupt every 100 us": ("storm.c",),
    "interrupt every 10 us": ("storm.c", "-DPERIOD=146"),
}
FIRMWARE = {"kernel with busy threads": ("compute", 0), "Listing 1": ("listing1", 0), "clustering": ("clustering", 8)}
"""Application and selector position of each firmware image."""
RED = (80, 0, 0)
"""Colour before the camera; it causes the same work for every line of every frame."""


def images(folder: Path, only: str) -> dict[str, Path]:
    """Return the images to run whose name contains `only`."""
    found = {}
    for name, (source, *words) in SOURCES.items():
        for level in ("-Os", "-O0"):
            if only in (title := f"{name} {level}"):
                found[title] = folder / f"{source}{level}{''.join(words)}.elf"
                command = ["-m", "toolchain", "cc", level, "-g", *words, str(ROOT / "bench" / "c" / source)]
                subprocess.run([sys.executable, *command, "-o", str(found[title])], check=True, cwd=ROOT)
    for name, (app, _) in FIRMWARE.items():
        if only in name:
            command = ["make", "-s", "-C", str(ROOT / "firmware"), f"APP={app}", f"PYTHON={sys.executable}"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            found[name] = folder / f"{app}.elf"
            shutil.copy(ROOT / "firmware" / "build" / app / "firmware.elf", found[name])
    return found


def machine_seconds(image: Path, name: str, cycles: int, how: str) -> float:
    """Return host seconds of `cycles`, after a warm-up of the same length; `how`: "plain", "counted" or "timed"."""
    _, selector = FIRMWARE.get(name, ("", 0))
    machine = emu.load(image, board=partial(Epuck, selector=selector))
    machine.board.camera.show(np.full((480, 640, 3), RED, np.uint8))
    assert isinstance(machine.runner, JitEngine)
    assert machine.image is not None
    machine.runner.wait = True
    with ExitStack() as stack:
        if how != "plain":
            stack.enter_context(Profiler(machine, machine.image, timed=how == "timed").counting())
        machine.run_until(cycles)
        start = time.process_time()
        machine.run_until(2 * cycles)
    return time.process_time() - start


def process_seconds(image: Path, name: str, seconds: float, how: str) -> float:
    """Return host seconds of a whole `emu run` or `emu profile` process."""
    folder = image.parent
    more = {"plain": [], "counted": [], "timed": ["--speedscope", str(folder / "timeline.json")]}[how]
    words = ["run" if how == "plain" else "profile", str(image), "--seconds", f"{seconds:g}", *more]
    words += ["--selector", str(FIRMWARE[name][1])] if name in FIRMWARE else []
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "emu", *words], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL, cwd=ROOT)  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    """Measure and print the table."""
    assert __doc__ is not None
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20, help="simulated time of a run (default 20)")
    parser.add_argument("--repeat", type=int, default=3, help="pairs of runs (default 3)")
    parser.add_argument("--only", default="", metavar="WORD", help="images with this in their name")
    parser.add_argument("--timed", action="store_true", help="keep what happened in order too")
    parser.add_argument("--cold", action="store_true", help="whole processes, from start to end")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    how, cycles = "timed" if options.timed else "counted", int(options.seconds * MIPS)

    def once(image: Path, name: str, kind: str) -> float:
        if options.cold:
            return process_seconds(image, name, options.seconds, kind)
        return machine_seconds(image, name, cycles, kind)

    ratios = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, image in images(Path(folder), options.only).items():
            pairs = [(once(image, name, "plain"), once(image, name, how)) for _ in range(options.repeat)]
            plain, other = map(min, zip(*pairs, strict=True))
            ratios[name] = other / plain
            if not options.json:
                print(f"{name:28} {ratios[name]:6.2f} x the time of a plain run", flush=True)
    if options.json:
        print(json.dumps(ratios))
    return 0


if __name__ == "__main__":
    sys.exit(main())
