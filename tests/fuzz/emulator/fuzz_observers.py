"""Compare runs under random observers with unobserved runs: random programs, every engine, cold and compiled code.

`python tests/fuzz/emulator/fuzz_observers.py [--programs N] [--seed S] [--seconds T]`. Exits with 1 at the first
difference. The summary counts the observers.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.emu.jit.comparison.engine_pair import Difference  # noqa: E402
from tests.emu.jit.comparison.observed_runs import check_observed  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402


def main() -> int:
    campaign = Campaign(parser(__doc__), "programs", 40, "random programs")
    campaign.parse()
    tally: Counter[str] = Counter()
    for seed in campaign:
        try:
            check_observed(seed, tally)
        except Difference as difference:
            return campaign.failed(str(difference))
    print(", ".join(f"{count} {name}" for name, count in tally.most_common()))
    return campaign.ended("no difference")


if __name__ == "__main__":
    sys.exit(main())
