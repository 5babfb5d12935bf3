"""Campaign: rows of the AVR table with random words and states, and programs in lock step, beside simavr.

A trial has 2,000 cases of every row, and a million instructions of one of ten programs.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from emu.avr.image import load_avr_image
from firmware.tools.simulated.machine import NotInstalled
from tests.emu.avr.oracle import Pair, compared_rows
from tests.fuzz.seeds import SKIPPED, Campaign, parser

PROGRAMS = Path(__file__).resolve().parents[2] / "emu" / "avr" / "programs.c"
CASES, STEPS = 2_000, 1_000_000


def images(folder: Path) -> list[bytes]:
    """Return the flash of the ten programs."""
    found = []
    for program in range(10):
        out = folder / f"{program}.elf"
        level = ("-Os", "-O2", "-O3", "-O1")[program % 4]
        command = ["avr-gcc", "-mmcu=atmega328p", "-std=gnu99", level, f"-DPROGRAM={program}", str(PROGRAMS), "-lm"]
        subprocess.run([*command, "-o", str(out)], check=True)
        found.append(load_avr_image(str(out)).flash)
    return found


def main() -> int:
    campaign = Campaign(parser(__doc__), "tries", 20, "number of tries")
    campaign.parse()
    try:
        pair = Pair()
        with tempfile.TemporaryDirectory() as folder:
            programs = images(Path(folder))
    except (NotInstalled, FileNotFoundError) as missing:
        print(missing)
        return SKIPPED
    rows = compared_rows()
    for seed in campaign:
        for row in rows:
            if told := pair.row(row, CASES, seed):
                return campaign.failed(told)
        pair.load(programs[seed % len(programs)])
        if told := pair.lockstep(STEPS):
            return campaign.failed(f"program {seed % len(programs)}: {told}")
    return campaign.ended(f"{campaign.done * CASES} cases of {len(rows)} rows, {campaign.done * STEPS} instructions")


if __name__ == "__main__":
    sys.exit(main())
