"""Measure the speed of firmware that accesses one device all the time, as a multiple of real time.

    python -m bench.emulator.devices [--seconds S] [--repeat N] [--only NAME] [--json]

Each figure is the median of N runs of host CPU time. Two counts per simulated second are printed beside it:
instructions that the interpreter executes, and exits from native code for any reason. The programs are in c/devices.c.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import emu
from emu.dspic30f.jit.engine import JitEngine

ROOT = Path(__file__).resolve().parents[2]
SOURCE = Path(__file__).parents[1] / "c" / "devices.c"
MIPS = 14_745_600  # engines.md §4.2
WARM_UP = 5_000_000
"""Duration of the warm-up in Tcy of simulated time."""
BYTES = 11_520
"""Bytes per second that UART2 receives at 115200 baud."""
PROGRAMS = {
    "line": "printf on UART1, 115200 baud, polled",
    "talk": "UART2 at 115200 baud, an echo by interrupt",
    "wire": "SPI1, 16 bits at 1/4 Tcy, polled",
    "bus": "I2C at 100 kHz, polled",
    "duty": "PWM of 20 kHz, a new duty each period",
}


def measure(image: Path, cycles: int, repeat: int) -> dict[str, float]:
    """Return the multiple of real time, and the exits from native code per simulated second."""
    machine = emu.load(image, engine="jit")
    assert isinstance(machine.runner, JitEngine)
    said: list[int] = []
    for uart in machine.uart.values():
        uart.listen(lambda byte, _start: said.append(byte), lazy=True)
    machine.runner.wait = True
    machine.run(cycles=WARM_UP)
    machine.uart[2].feed(bytes(BYTES * repeat * cycles // MIPS))
    counts, speeds = machine.runner.counts, []
    interpreted, runs = counts.interpreted, counts.runs
    for _ in range(repeat):
        start = time.process_time()
        machine.run(cycles=cycles)
        speeds.append(cycles / MIPS / (time.process_time() - start))
    seconds = repeat * cycles / MIPS
    return {
        "speed": statistics.median(speeds),
        "interpreted": (counts.interpreted - interpreted) / seconds,
        "returns": (counts.runs - runs) / seconds,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=5.0, help="simulated seconds per run (default %(default)s)")
    parser.add_argument("--repeat", type=int, default=3, help="runs (default %(default)s)")
    parser.add_argument("--only", choices=PROGRAMS, help="one program")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    report = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in [options.only] if options.only else PROGRAMS:
            image = Path(folder) / f"{name}.elf"
            command = [sys.executable, "-m", "toolchain", "cc", "-Os", f"-D{name.upper()}", str(SOURCE), "-o"]
            subprocess.run([*command, str(image)], check=True, cwd=ROOT)
            report[name] = measure(image, int(options.seconds * MIPS), options.repeat)
    if options.json:
        print(json.dumps(report))
        return 0
    print(f"{'program':52}{'x real time':>12}{'sequencer/s':>13}{'returns/s':>11}")
    for name, row in report.items():
        print(f"{PROGRAMS[name]:52}{row['speed']:>12.1f}{row['interpreted']:>13.0f}{row['returns']:>11.0f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
