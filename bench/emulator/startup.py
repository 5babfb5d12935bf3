"""Measure the time to the emulator's first output, and the cost of a `run_until` without work.

Host seconds from process start to the first UART byte are measured for a small image and for the kernel's Listing 1,
whose first line appears at 250 ms: with cached objects of earlier runs (engines.md §9: 0.8 s) and without (4 s). Host
time per `Machine.run_until` is measured for one cycle of a sleeping machine (engines.md §4.3: 1 µs).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
IMAGE = ROOT / "tests" / "emu" / "cli" / "hello.hex"
KERNEL = ROOT / "firmware" / "build" / "listing1" / "firmware.elf"
CALLS = 200_000


def first_byte(engine: str, image: Path = IMAGE, cache: str | None = None) -> float:
    """Return seconds from process start to the first byte on standard output."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "emu", "run", str(image), "--engine", engine, "--seconds", "1"]
    environment = dict(os.environ) | ({"OPENSWARM_CACHE": cache} if cache is not None else {})
    with subprocess.Popen(
        command, cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdout is not None
        assert process.stdout.read(1)
        seconds = time.perf_counter() - start
        process.terminate()
    return seconds


def cold(engine: str, image: Path) -> float:
    """Return seconds from process start to the first byte, with an empty cache."""
    with tempfile.TemporaryDirectory() as empty:
        return first_byte(engine, image, empty)


def seconds_per_call(engine: str) -> float:
    """Return seconds per `run_until` of one cycle, on a machine that idles until a distant timer match."""
    from emu.image.loader import load_image
    from emu.machine.machine import Machine

    machine = Machine(engine=engine)
    machine.load(load_image(IMAGE))
    machine.write("PR1", 0xFFFF)
    machine.write("T1CON", 0x8030)  # on, 1:256: 16.7 million Tcy to the match
    machine.write("IEC0", 1 << 3)
    machine.run(cycles=100_000)
    cycle = machine.cycle
    start = time.perf_counter()
    for later in range(cycle + 1, cycle + 1 + CALLS):
        machine.run_until(later)
    return (time.perf_counter() - start) / CALLS


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--runs", type=int, default=5, metavar="N", help="processes to start per engine (default 5)")
    options = parser.parse_args()
    build = ["make", "-C", str(ROOT / "firmware"), "APP=listing1", f"PYTHON={sys.executable}"]
    subprocess.run(build, check=True, capture_output=True)
    facts = {}
    for engine in ("plain", "jit"):
        times = [first_byte(engine) for _ in range(options.runs + 1)][1:]
        facts[engine] = {
            "first_byte_seconds": min(times),
            "first_byte_cold_seconds": min(cold(engine, IMAGE) for _ in range(options.runs)),
            "kernel_seconds": min([first_byte(engine, KERNEL) for _ in range(options.runs + 1)][1:]),
            "kernel_cold_seconds": min(cold(engine, KERNEL) for _ in range(options.runs)),
            "run_until_microseconds": 1e6 * seconds_per_call(engine),
        }
    if options.json:
        print(json.dumps(facts, indent=2))
        return 0
    print(f"{'engine':8} {'first UART byte':>16} {'cold':>8} {'Listing 1':>11} {'cold':>8} {'run_until':>12}")
    for engine, row in facts.items():
        print(f"{engine:8} {row['first_byte_seconds']:14.2f} s {row['first_byte_cold_seconds']:6.2f} s "
              f"{row['kernel_seconds']:9.2f} s {row['kernel_cold_seconds']:6.2f} s "
              f"{row['run_until_microseconds']:9.2f} us")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
