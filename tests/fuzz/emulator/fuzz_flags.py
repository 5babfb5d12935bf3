"""Compare all engines on short programs of instructions that write flags and instructions that read them.

`python tests/fuzz/emulator/fuzz_flags.py [--images N] [--seed S] [--seconds T]`. An image has 24 programs; each is
run from 16 states and interrupted after every number of cycles. Exits with 1 at the first difference. The summary
counts the pairs of an instruction that writes a flag and one that reads it, out of all in the table; about 460 images
contain all pairs.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.emu.jit.comparison.flag_drills import Tally, all_pairs, check  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402


def main() -> int:
    campaign = Campaign(parser(__doc__), "images", 60, "images of 24 drills, each run 16 times")
    campaign.parse()
    tally = Tally()
    for seed in campaign:
        if found := check(seed, tally):
            return campaign.failed(found)
    known = set(all_pairs())
    python = 100 * tally.python / tally.executed
    return campaign.ended(
        f"{tally.runs} runs without a difference; {len(known & tally.pairs.keys())} of {len(known)} pairs of writer, "
        f"flag and reader; {python:.0f} % of instructions were Python's"
    )


if __name__ == "__main__":
    sys.exit(main())
