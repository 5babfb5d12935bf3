"""Random sequences of heap operations, a million allocations.

Usage: `python tests/fuzz/kernel/fuzz_heap.py [--histories N] [--seconds S]`. The emulated robot sends events, starts
and kills threads, registers and subscribes at random, and times each call with a hardware timer. The output states
the maximum Tcy of each kind of call. The campaign fails if Sys_Send_Event or Sys_Start_Process takes longer than the
limit in openswarm.h.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.firmware.kernel.test_heap_on_target import Histories  # noqa: E402
from tests.fuzz.kernel.fuzz_kernel import build  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

STEPS = 20_000


def main() -> int:
    what = f"histories of {STEPS:,} steps, about 14,000 measured calls each"
    campaign = Campaign(parser(__doc__), "histories", 80, what)
    campaign.parse()
    with tempfile.TemporaryDirectory() as folder:
        histories = Histories(build("heap", Path(folder)))
        for seed in campaign:
            try:
                histories.run(seed, STEPS)
            except AssertionError as error:
                return campaign.failed(error)
    return campaign.ended(str(histories))


if __name__ == "__main__":
    sys.exit(main())
