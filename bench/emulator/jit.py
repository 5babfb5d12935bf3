"""Measure the speed of native code: C that computes, busy threads, an interrupt storm; compared with simavr and QEMU.

    python -m bench.emulator.jit [--seconds S] [--repeat N] [--json]

Each figure is the median of N paired runs and counts host CPU time, as a multiple of real time (14.7456 MIPS). The
interpreter runs the same image for a shorter time. simavr and qemu-system-avr run the same C source, compiled by
avr-gcc -Os for an ATmega2560; the comparison is rounds of that source per host second. Missing tools are named and
omitted. Compile time is reported separately, with an empty cache (cold) and with a full one (warm).
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import emu
from emu.dspic30f.jit.engine import JitEngine

ROOT = Path(__file__).resolve().parents[2]
SOURCES = Path(__file__).parents[1] / "c"
MIPS = 14_745_600  # engines.md §4.2
WARM_UP = {"jit": 3_000_000_000, "plain": 1_000_000}
"""Tcy before a measurement: native code until its hot regions are compiled again (emu/dspic30f/jit/hot_regions.py)."""
INTERPRETER_SHARE = 100
"""Ratio of the simulated times of native code and the interpreter."""


def build(source: Path, output: Path, *flags: str) -> None:
    """Compile one file for the robot at -Os."""
    command = [sys.executable, "-m", "toolchain", "cc", "-Os", *flags, str(source), "-o", str(output)]
    subprocess.run(command, check=True, cwd=ROOT)


def build_kernel(output: Path) -> None:
    """Build the kernel with eight computing threads (firmware/apps/compute)."""
    subprocess.run(
        ["make", "-s", "-C", str(ROOT / "firmware"), "APP=compute", f"PYTHON={sys.executable}"],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    shutil.copy(ROOT / "firmware" / "build" / "compute" / "firmware.elf", output)


def machine(image: Path, engine: str) -> emu.Machine:
    """Return a machine that has finished its start-up and whose native code is complete and will not be replaced."""
    loaded = emu.load(image, engine=engine)
    if isinstance(loaded.runner, JitEngine):
        loaded.runner.wait = True
    loaded.run(cycles=WARM_UP[engine])
    return loaded


def times_real(target: emu.Machine, cycles: int) -> float:
    """Run until cycle `target` and return the speed over `cycles` as a multiple of real time."""
    start = time.process_time()
    target.run(cycles=cycles)
    return cycles / MIPS / (time.process_time() - start)


def measure(image: Path, cycles: int, repeat: int) -> dict[str, float]:
    """Return medians of paired runs of one image under both engines."""
    native, plain = machine(image, "jit"), machine(image, "plain")
    pairs = [(times_real(native, cycles), times_real(plain, cycles // INTERPRETER_SHARE)) for _ in range(repeat)]
    fast = statistics.median(pair[0] for pair in pairs)
    return {
        "jit": fast,
        "plain": statistics.median(pair[1] for pair in pairs),
        "ratio": statistics.median(a / b for a, b in pairs),
    }


def two_at_once(image: Path, cycles: int) -> float:
    """Return the speed of two machines in two threads relative to one, by wall time; the ideal on two idle cores is
    2."""
    machines = [machine(image, "jit") for _ in range(2)]
    start = time.perf_counter()
    machines[0].run(cycles=cycles)
    alone = time.perf_counter() - start
    threads = [threading.Thread(target=one.run, kwargs={"cycles": cycles}) for one in machines]
    start = time.perf_counter()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return 2 * alone / (time.perf_counter() - start)


def compile_seconds(image: Path) -> tuple[float, float]:
    """Return host seconds of compilation with an empty and with a full cache."""
    with tempfile.TemporaryDirectory() as cache:
        os.environ["OPENSWARM_CACHE"] = cache
        spent = []
        for _ in range(2):
            start = time.perf_counter()
            machine(image, "jit")
            spent.append(time.perf_counter() - start)
        del os.environ["OPENSWARM_CACHE"]
    return spent[0], spent[1]


def cycles_per_round(image: Path, rounds: int) -> float:
    """Return Tcy of one round of compute.c, measured over a whole run."""
    return emu.load(image).run().cycle / rounds


def avr_image(folder: Path, rounds: int) -> Path:
    """Build compute.c for the AVR emulators."""
    output = folder / f"avr{rounds}.elf"
    subprocess.run(
        [
            "avr-gcc",
            "-mmcu=atmega2560",
            "-Os",
            "-fno-lto",
            f"-DROUNDS={rounds}",
            str(SOURCES / "compute_avr.c"),
            "-o",
            str(output),
        ],
        check=True,
    )
    return output


def until_done(command: list[str]) -> float:
    """Return host seconds until the emulator prints the `D` of compute_avr.c."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
    assert process.stdout is not None
    while (byte := process.stdout.read(1)) not in (b"D", b""):
        pass
    spent = time.perf_counter() - start
    process.kill()
    process.wait()
    if byte == b"":
        raise RuntimeError(f"{command[0]} ended without having finished the program")
    return spent


EMULATORS: dict[str, Callable[[Path], list[str]]] = {
    "simavr": lambda image: ["simavr", "-m", "atmega2560", "-f", "16000000", str(image)],
    "qemu-system-avr": lambda image: ["qemu-system-avr", "-M", "mega2560", "-bios", str(image), "-nographic"],
}


def other_emulators(folder: Path, repeat: int) -> tuple[dict[str, float], list[str]]:
    """Return rounds of compute.c per host second in other emulators, without their start-up, and notes on missing
    ones."""
    found: dict[str, float] = {}
    notes = []
    for name, command in EMULATORS.items():
        if not shutil.which(name) or not shutil.which("avr-gcc"):
            notes.append(f"{name}: omitted, install the Debian packages gcc-avr avr-libc simavr qemu-system-misc")
            continue
        few, many = (20, 200) if name == "simavr" else (100, 2000)
        images = avr_image(folder, few), avr_image(folder, many)
        pairs = [(until_done(command(images[0])), until_done(command(images[1]))) for _ in range(repeat)]
        found[name] = statistics.median((many - few) / (long - short) for short, long in pairs)
    return found, notes


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0, help="simulated seconds per run (default %(default)s)")
    parser.add_argument("--repeat", type=int, default=3, help="paired runs (default %(default)s)")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    cycles = int(options.seconds * MIPS)
    report: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        build(SOURCES / "compute.c", folder / "compute.elf", "-DROUNDS=65000")
        build(SOURCES / "compute.c", folder / "rounds.elf", "-DROUNDS=50")
        build(SOURCES / "storm.c", folder / "storm.elf")
        build_kernel(folder / "kernel.elf")
        for image in ("compute", "kernel", "storm"):
            report[image] = measure(folder / f"{image}.elf", cycles, options.repeat)
            report[image]["two"] = two_at_once(folder / f"{image}.elf", cycles)
            report[image]["cold_s"], report[image]["warm_s"] = compile_seconds(folder / f"{image}.elf")
        ours = report["compute"]["jit"] * MIPS / cycles_per_round(folder / "rounds.elf", 50)
        rates, notes = other_emulators(folder, options.repeat)
        report["rounds_per_s"] = {"jit": ours, **rates}
        report["notes"] = notes
    if options.json:
        print(json.dumps(report))
        return 0
    print(f"{'program':10}{'jit':>12}{'interpreter':>14}{'ratio':>9}{'two at once':>13}", end="")
    print(f"{'cold start':>13}{'warm start':>12}")
    for image in ("compute", "kernel", "storm"):
        row = report[image]
        print(
            f"{image:10}{row['jit']:>9.1f} x {row['plain']:>12.3f} x{row['ratio']:>9.0f}"
            f"{row['two']:>11.2f} x{row['cold_s']:>11.2f} s{row['warm_s']:>10.2f} s"
        )
    for name, rate in report["rounds_per_s"].items():
        print(f"{name:18}{rate:10.1f} rounds of compute.c per second, ours is {ours / rate:.1f} times that")
    for note in report["notes"]:
        print(note)
    return 0


if __name__ == "__main__":
    sys.exit(main())
