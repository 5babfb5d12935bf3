"""An hour of clock events on the emulated robot: `python tests/fuzz/fuzz_clock.py [--ticks N]`.

3,600,000 events of 1 ms must take exactly 53,084,160,000 Tcy (kernel.md §3) while threads never yield, a device sends
every 100 us and a handler resends for ever. Prints the worst jitter of the clock's interrupt too.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.firmware.test_time_on_target import count_clock  # noqa: E402
from tests.fuzz.fuzz_kernel import build  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ticks", type=int, default=3_600_000, help="clock events, a multiple of 5 (default an hour)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print(count_clock(build("slices", Path(folder)), options.ticks), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
