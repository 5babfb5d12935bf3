"""Interrupts and failed allocations in kernel calls: `python tests/fuzz/kernel/fuzz_kernel.py [--rounds N] [--stride
N]`.

A sample of this campaign is tests/firmware/kernel/test_every_instruction.py. A round interrupts every kernel call at
every instruction boundary, by all interrupts together or one after the other, without or with IPL slip (kernel.md
§4); the seed selects one of these four kinds of rounds. The interrupt handler makes every call of the public headers,
also those that handlers must not make. With --stride a round tests every N-th boundary, from a first one that depends
on its seed. Without --seconds, every allocation also fails once, and threads that check all their registers are
preempted. An interrupted round resumes with the --seed and --scene in its last output line.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.firmware.injection import MODES, fail_every_allocation, sweep  # noqa: E402
from tests.firmware.kernel.test_kernel_on_target import load, place  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

SPARSE = 499
"""Default stride if the duration is limited by --seconds."""


def build(app: str, out: Path, apps: str = "../tests/firmware/target") -> Path:
    """Build an application of tests/firmware/target, or of another folder relative to firmware/, and return its
    image."""
    words = [f"APP={app}", f"APPS={apps}", f"OUT={out / app}", f"PYTHON={sys.executable}"]
    subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), *words], check=True)
    return out / app / "firmware.elf"


def preempt_patterns(path: Path, wanted: int) -> None:
    """Preempt threads that keep patterns in all registers, DSP state and DO loops, `wanted` times, with an interrupt
    every 100 us."""
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
    campaign = Campaign(parser(__doc__), "rounds", 4, "rounds of calls")
    add = campaign.parser.add_argument
    add("--stride", type=int, help=f"every N-th boundary (default 1: 5 minutes a round; {SPARSE} with --seconds)")
    add("--scene", type=int, default=0, help="begin with this scene of target/calls")
    add("--preemptions", type=int, default=100_000, help="of threads with patterns (default %(default)s)")
    options = campaign.parse()
    stride = options.stride or (1 if options.seconds is None else SPARSE)
    with tempfile.TemporaryDirectory() as folder:
        calls, registers = (build(app, Path(folder)) for app in ("calls", "registers"))
        try:
            for seed in campaign:
                mode, slip = MODES[seed // 2 % len(MODES)], seed % 2
                for done, seen in sweep(calls, slip, mode, stride, seed % stride, options.scene):
                    if options.seconds is None:
                        print(f"--seed {seed} --scene {done} ({mode}, slip {slip}): {seen}", flush=True)
                print(f"{mode}, slip {slip}: {seen}", flush=True)
            if options.seconds is None:
                for done, failures in fail_every_allocation(calls):
                    print(f"{failures} allocations failed in {done} scenes, nothing lost or leaked", flush=True)
                preempt_patterns(registers, options.preemptions)
        except AssertionError as error:
            return campaign.failed(error)
    return campaign.ended("nothing lost, doubled or leaked")


if __name__ == "__main__":
    sys.exit(main())
