"""The kernel under interrupts: `python tests/fuzz/fuzz_kernel.py [--stride N] [--preemptions N]`.

The campaign behind tests/firmware/test_on_target.py, which samples. Runs a round of kernel calls once for each
instruction boundary, with tick, stepper and a sending device arriving there, without and with IPL slip (kernel.md §4).
Then preempts threads that check all their registers.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.firmware.test_on_target import interrupt_every_boundary, load, place, start_of_scenario  # noqa: E402


def build(app: str, out: Path) -> Path:
    """An application of tests/firmware/target."""
    words = [f"APP={app}", "APPS=../tests/firmware/target", f"OUT={out / app}", f"PYTHON={sys.executable}"]
    subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), *words], check=True)
    return out / app / "firmware.elf"


def preempt_patterns(path: Path, wanted: int) -> None:
    """Threads with patterns in all registers, DSP state and DO loops, preempted `wanted` times under a 100 us storm."""
    machine = load(path)
    machine.run(cycles=200_000)
    machine.write("PR2", 60)  # slices of 488 Tcy
    switches = 0

    def count(*_: object) -> None:
        nonlocal switches
        switches += 1

    machine.hook_pc(place(machine, "_T2Interrupt"), count)
    while switches < wanted:
        machine.run(cycles=1_000_000)
        assert machine.peek("broken") == 0, f"thread {machine.peek('broken')} lost a register"
    print(f"{switches} preemptions, every register kept", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stride", type=int, default=4, help="try every N-th boundary (default 4; 1 takes minutes)")
    parser.add_argument("--preemptions", type=int, default=100_000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        points, registers = (build(app, Path(folder)) for app in ("points", "registers"))
        for ipl_slip in (0, 1):
            machine = start_of_scenario(points, ipl_slip)
            tried = interrupt_every_boundary(machine, options.stride, 0)
            print(f"ipl-slip {ipl_slip}: {tried} boundaries, nothing lost, doubled or leaked", flush=True)
        preempt_patterns(registers, options.preemptions)
    return 0


if __name__ == "__main__":
    sys.exit(main())
