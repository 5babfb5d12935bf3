"""Clock events for an hour on the emulated robot: `python tests/fuzz/kernel/fuzz_clock.py [--hours N] [--seconds T]`.

3,600,000 events of 1 ms must take exactly 53,084,160,000 Tcy (kernel.md §3). Meanwhile threads never yield, a device
sends every 100 us and a handler sends an event again whenever it receives it. The output also states the maximum
jitter of the clock's interrupt. With --seconds, the campaign tests a thousand events at a time, from a number that
depends on the seed, until the time is over.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.firmware.kernel.test_time_on_target import count_clock  # noqa: E402
from tests.fuzz.kernel.fuzz_kernel import build  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

HOUR = 3_600_000


def main() -> int:
    campaign = Campaign(parser(__doc__), "hours", 1, "hours of clock events")
    options = campaign.parse()
    with tempfile.TemporaryDirectory() as folder:
        image = build("slices", Path(folder))
        for seed in campaign:
            ticks = HOUR if options.seconds is None else 10_000 + 5 * (seed % 2_000)
            try:
                print(count_clock(image, ticks), flush=True)
            except AssertionError as error:
                return campaign.failed(error)
    return campaign.ended("every event counted, none late")


if __name__ == "__main__":
    sys.exit(main())
