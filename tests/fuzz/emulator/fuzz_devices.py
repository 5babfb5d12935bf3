"""Compare all engines on random programs that mainly access device registers: state, UART bytes, rendered lines.

`python tests/fuzz/emulator/fuzz_devices.py [--programs N] [--seed S] [--seconds T] [--engine NAME] [--chip NAME]
[--show]`. Exits with 1 at the first difference. Every fourth seed runs on a fictitious chip unless --chip names a
chip. The summary counts the accesses per register; --show prints the program of a seed instead.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from emu.chips.chip import Chip  # noqa: E402
from tests.emu.peripherals.drills.device_programs import CHIPS, difference, program, words_of  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402


def main() -> int:
    campaign = Campaign(parser(__doc__), "programs", 150, "random programs")
    campaign.parser.add_argument("--engine", choices=("jit",), help="compared with the plain one")
    campaign.parser.add_argument("--chip", choices=CHIPS, help="(default: by seed)")
    campaign.parser.add_argument("--show", action="store_true", help="print the first program and end")
    options = campaign.parse()
    real, made_up = CHIPS

    def chip(seed: int) -> Chip:
        return CHIPS[options.chip or (made_up if seed % 4 == 3 else real)]

    if options.show:
        print(program(campaign.first, chip(campaign.first))[0])
        return 0
    touched: Counter[tuple[str, str]] = Counter()
    engines = [options.engine] if options.engine else ["jit"]
    for seed in campaign:
        found = difference(seed, *engines, chip=chip(seed), tally=touched)
        if found is not None:
            return campaign.failed(found)
    ways: Counter[str] = Counter()
    for (_name, way), count in touched.items():
        ways[way] += count
    print(", ".join(f"{count} {way}" for way, count in sorted(ways.items())))
    words = {sfr.name for sfr in words_of(options.chip or real)}
    names = {name for name, _ in touched} & words
    return campaign.ended(f"{len(names)} of {len(words)} registers touched, no difference")


if __name__ == "__main__":
    sys.exit(main())
