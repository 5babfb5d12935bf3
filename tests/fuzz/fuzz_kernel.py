"""The kernel under interrupts and without memory: `python tests/fuzz/fuzz_kernel.py [--stride N] [--preemptions N]`.

The campaign behind tests/firmware/test_every_instruction.py, which samples: every kernel call is interrupted at every
instruction boundary by all interrupts together and by them one after the other, without and with IPL slip (kernel.md
§4), and every allocation fails once. Then threads that check all their registers are preempted. An interrupted
campaign goes on with --way, --ipl-slip and --scene, as its last line said.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.firmware.injection import WAYS, fail_every_allocation, sweep  # noqa: E402
from tests.firmware.test_on_target import load, place  # noqa: E402


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


def interrupt_everywhere(path: Path, options: argparse.Namespace) -> None:
    """Every boundary in every way, from where the last run was told to go on."""
    for way in WAYS[WAYS.index(options.way) :]:
        for ipl_slip in (0, 1)[options.ipl_slip :]:
            for done, seen in sweep(path, ipl_slip, way, options.stride, first=options.scene):
                print(f"--way {way} --ipl-slip {ipl_slip} --scene {done}: {seen}", flush=True)
            options.scene = 0
        options.ipl_slip = 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stride", type=int, default=1, help="try every N-th boundary (default 1: 20 minutes)")
    parser.add_argument("--way", choices=WAYS, default=WAYS[0], help="begin with this way of injection")
    parser.add_argument("--ipl-slip", type=int, choices=(0, 1), default=0, help="... and this slip")
    parser.add_argument("--scene", type=int, default=0, help="... and this scene of target/calls")
    parser.add_argument("--preemptions", type=int, default=100_000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        calls, registers = (build(app, Path(folder)) for app in ("calls", "registers"))
        for done, failures in fail_every_allocation(calls):
            print(f"{failures} allocations failed in {done} scenes, nothing lost or leaked", flush=True)
        interrupt_everywhere(calls, options)
        preempt_patterns(registers, options.preemptions)
    return 0


if __name__ == "__main__":
    sys.exit(main())
