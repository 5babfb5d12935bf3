"""Compare the whole state of all engines on random (instruction, context) pairs and random programs.

`python tests/fuzz/emulator/fuzz_engines.py [--batches N] [--seed S] [--seconds T] [--engine NAME] [--chip NAME]`. A
batch runs every row of the instruction table in 20 contexts, and 20 programs. Exits with 1 at the first difference.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from emu.dspic30f.isa.table import ROWS  # noqa: E402
from tests.emu.chips.made_up import CHIPS  # noqa: E402
from tests.emu.cpu.engine_fuzz import Difference, check_pairs, check_programs  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

CONTEXTS = 20
"""Number of contexts per instruction."""
PROGRAMS = 20
"""Number of programs per seed."""


def main() -> int:
    what = f"batches of {len(ROWS) * CONTEXTS} pairs, {PROGRAMS} programs"
    campaign = Campaign(parser(__doc__), "batches", 220, what)
    campaign.parser.add_argument("--engine", default="jit", help="compared with the plain one (default %(default)s)")
    campaign.parser.add_argument("--chip", choices=CHIPS, default="dsPIC30F6014A", help="(default %(default)s)")
    options = campaign.parse()
    chip = CHIPS[options.chip]
    pairs = cycles = 0
    try:
        for seed in campaign:
            pairs += check_pairs(seed, len(ROWS), CONTEXTS, options.engine, chip)
            cycles += check_programs(seed, PROGRAMS, options.engine, chip)
    except Difference as difference:
        return campaign.failed(difference)
    return campaign.ended(f"{pairs} pairs and {PROGRAMS * campaign.done} programs ({cycles} cycles), no difference")


if __name__ == "__main__":
    sys.exit(main())
