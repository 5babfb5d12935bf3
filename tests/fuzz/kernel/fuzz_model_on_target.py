"""Random programs of kernel calls on the emulated dsPIC30F and, in QEMU, on a Cortex-M4 and a RISC-V, and on the model.

Usage: `python tests/fuzz/kernel/fuzz_model_on_target.py [--batches N] [--seconds S] [--target NAME]`. Each seed makes a
batch of 20 programs and runs it on one target; three seeds in a row visit all targets. Every call must return what the
model returns (tests/firmware/model). The campaign prints the program that differs.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from firmware.tools.simulated.machine import NotInstalled  # noqa: E402
from tests.firmware.conftest import TARGET_APPS  # noqa: E402
from tests.firmware.model import on_target  # noqa: E402
from tests.firmware.model.compare import random_programs  # noqa: E402
from tests.firmware.ports.targets import BOARDS, make  # noqa: E402
from tests.fuzz.seeds import SKIPPED, Campaign, parser  # noqa: E402

PROGRAMS = 20
TARGETS = ("epuck", *BOARDS)


def machine_of(target: str, out: Path) -> on_target.Comparison | None:
    """Return a target that runs programs, or None if its compiler or QEMU is not installed."""
    defines = on_target.DEFINES_IN_QEMU if target in BOARDS else on_target.DEFINES
    try:
        image = make(target, "model", out, f"DEFINES={defines}", f"PYTHON={sys.executable}", apps=TARGET_APPS)
        return on_target.CpuInQemu(BOARDS[target], image) if target in BOARDS else on_target.Robot(image)
    except (NotInstalled, pytest.skip.Exception) as missing:
        print(f"skipped: {missing}", flush=True)
        return None


def main() -> int:
    campaign = Campaign(parser(__doc__), "batches", 30, f"batches of {PROGRAMS} programs")
    campaign.parser.add_argument("--target", choices=TARGETS, help="only this target")
    options = campaign.parse()
    targets = (options.target,) if options.target else TARGETS
    machines: dict[str, on_target.Comparison | None] = {}
    with tempfile.TemporaryDirectory() as folder:
        for seed in campaign:
            target = targets[seed % len(targets)]
            if target not in machines:
                machines[target] = machine_of(target, Path(folder, target))
            machine = machines[target]
            if machine is None:
                continue
            for program in random_programs(seed, PROGRAMS):
                try:
                    difference = machine.difference(program)
                except AssertionError as error:
                    return campaign.failed(error)
                if difference is not None:
                    return campaign.failed(f"{target} and model differ after\n{program}\n{difference}")
    ran = [f"{machine.compared:,} programs on {target}" for target, machine in machines.items() if machine is not None]
    if not ran:
        return SKIPPED
    return campaign.ended(f"{', '.join(ran)}, no difference")


if __name__ == "__main__":
    sys.exit(main())
