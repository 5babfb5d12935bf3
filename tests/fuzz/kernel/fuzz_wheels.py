"""Every wheel speed for a minute: `python tests/fuzz/kernel/fuzz_wheels.py [--speeds N] [--duration D] [--seconds
T]`.

A sample of this campaign is tests/firmware/drivers/test_wheels_on_target.py. Both wheels run at independent speeds
from -129 to 129 mm/s; the seed selects the first speed. The number of steps in D simulated seconds (default 60) must
be within 1 of the exact number.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.firmware.wheels import FASTEST, measure, partner, start  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

SPEEDS = 2 * FASTEST + 1


def main() -> int:
    campaign = Campaign(parser(__doc__), "speeds", SPEEDS, "speeds")
    campaign.parser.add_argument("--duration", type=float, default=60.0, help="simulated seconds (default %(default)g)")
    options = campaign.parse()
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        words = ["APP=wheels", "APPS=../tests/firmware/target", f"OUT={folder}", f"PYTHON={sys.executable}"]
        subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), *words], check=True)
        machine = start(Path(folder) / "firmware.elf")
        for seed in campaign:
            speed = seed % SPEEDS - FASTEST
            errors = measure(machine, speed, partner(speed), options.duration)
            worst = max(worst, *(abs(error) for error in errors))
            if worst > 1:
                return campaign.failed(f"{speed} and {partner(speed)} mm/s: {errors} steps away from exact")
    return campaign.ended(f"{options.duration:g} s each, worst error {worst:.3f} steps")


if __name__ == "__main__":
    sys.exit(main())
