"""Compare all engines on very short programs, hundreds per image, that access registers in all modes of access.

    python tests/fuzz/emulator/fuzz_register_access.py [--images N] [--seed S] [--seconds T] [--chip NAME] [--table]

Exits with 1 at the first difference. Every fourth seed runs on a fictitious chip unless --chip names a chip. The
summary counts the combinations of register, read or write, byte or word, and mode of access that never occurred;
--table lists them. --jobs N uses N processes.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import islice
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.emu.peripherals.drills.access_census import ACCESS_MODES, modes_of  # noqa: E402
from tests.emu.peripherals.drills.device_drills import registers_of  # noqa: E402
from tests.emu.peripherals.drills.device_programs import CHIPS  # noqa: E402
from tests.emu.peripherals.drills.drill_runs import Tally, check  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402


def one(seed: int, chip: str) -> tuple[str | None, Tally]:
    """Run the image of a seed. Return the first difference and the counts."""
    tally = Tally()
    return check(seed, CHIPS[chip], tally), tally


def results(campaign: Campaign, chip: str | None, jobs: int) -> Iterator[tuple[str | None, Tally]]:
    """Run the seeds of a campaign, `jobs` at a time, and report them in order."""
    real, made_up = CHIPS

    def named(seed: int) -> str:
        return chip or (made_up if seed % 4 == 3 else real)

    if jobs < 2:
        for seed in campaign:
            yield one(seed, named(seed))
        return
    with ProcessPoolExecutor(jobs) as pool:
        ahead = iter(range(campaign.first, 1 << 40))
        waiting = [pool.submit(one, seed, named(seed)) for seed in islice(ahead, 2 * jobs)]
        for _seed in campaign:
            yield waiting.pop(0).result()
            following = next(ahead)
            waiting.append(pool.submit(one, following, named(following)))
        for future in waiting:
            future.cancel()


def never(tally: Tally, chip: str) -> dict[tuple[str, int, str], list[str]]:
    """Return the registers of a chip that were never accessed, by read or write, size and mode of access."""
    made = modes_of(tally.accesses)
    return {
        (kind, size, way): [sfr.name for sfr in registers_of(chip) if not made[chip, sfr.address, write, size, way]]
        for kind, write in (("read", False), ("write", True))
        for size in (1, 2)
        for way in ACCESS_MODES
    }


def main() -> int:
    campaign = Campaign(parser(__doc__), "images", 60, "images of 40 drills, each run 30 times")
    campaign.parser.add_argument("--chip", choices=CHIPS, help="(default: by seed)")
    campaign.parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes (default 1)")
    campaign.parser.add_argument("--table", action="store_true", help="print what accesses were never made")
    options = campaign.parse()
    total = Tally()
    for found, tally in results(campaign, options.chip, options.jobs):
        if found is not None:
            return campaign.failed(found)
        total.add(tally)
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(total.kinds.items()))
    print(f"{total.programs} programs ({kinds}), {total.cycles} Tcy, {total.left} images left early")
    for chip in CHIPS:
        if any(key[0] == chip for key in total.accesses):
            gaps = never(total, chip)
            cells = len(gaps) * len(registers_of(chip))
            print(f"{chip}: {cells - sum(map(len, gaps.values()))} of {cells} kinds of access made")
            for (kind, size, way), names in gaps.items() if options.table else ():
                print(f"  {kind} {'byte' if size == 1 else 'word'} {way}: {len(names)} not: {' '.join(names)}")
    return campaign.ended("no difference")


if __name__ == "__main__":
    sys.exit(main())
