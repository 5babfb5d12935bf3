"""How soon the emulator says something, and what asking it to go on costs.

Measures host seconds from process start to the first UART byte of a small image (design §9: 0.8 s, warm), and host time
per `Machine.run_until` of a sleeping machine that is asked to go one more cycle (design §4.3: 1 µs).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
IMAGE = ROOT / "tests" / "emu" / "cli" / "hello.hex"
CALLS = 200_000


def first_byte(engine: str) -> float:
    """Seconds from starting the process to the first byte on its standard output."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "emu", "run", str(IMAGE), "--engine", engine]
    with subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdout is not None
        assert process.stdout.read(1) == b"h"
        seconds = time.perf_counter() - start
        process.stdout.read()
    return seconds


def seconds_per_call(engine: str) -> float:
    """Seconds per `run_until` one cycle on, of a machine that idles until a timer match far away."""
    sys.path.insert(0, str(ROOT))
    from emu.loader import load_image
    from emu.machine import Machine

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
    facts = {}
    for engine in ("interp", "jit"):
        times = [first_byte(engine) for _ in range(options.runs + 1)][1:]
        facts[engine] = {"first_byte_seconds": min(times), "run_until_microseconds": 1e6 * seconds_per_call(engine)}
    if options.json:
        print(json.dumps(facts, indent=2))
        return 0
    print(f"{'engine':8} {'first UART byte':>16} {'run_until':>12}")
    for engine, row in facts.items():
        print(f"{engine:8} {row['first_byte_seconds']:14.2f} s {row['run_until_microseconds']:9.2f} us")
    return 0


if __name__ == "__main__":
    sys.exit(main())
