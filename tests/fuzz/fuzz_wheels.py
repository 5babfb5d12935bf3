"""Every wheel speed for a minute: `python tests/fuzz/fuzz_wheels.py [--seconds S] [--step N]`.

The campaign behind tests/firmware/test_wheels_on_target.py: -129..129 mm/s on both wheels, unrelated to each other; the
steps of S simulated seconds (default 60) are within 1 of exact.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.firmware.wheels import FASTEST, measure, partner, start  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--step", type=int, default=1, help="try every N-th speed (default 1)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        words = ["APP=wheels", "APPS=../tests/firmware/target", f"OUT={folder}", f"PYTHON={sys.executable}"]
        subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), *words], check=True)
        machine = start(Path(folder) / "firmware.elf")
        worst, tried = 0.0, 0
        for speed in range(-FASTEST, FASTEST + 1, options.step):
            errors = measure(machine, speed, partner(speed), options.seconds)
            worst = max(worst, *(abs(error) for error in errors))
            assert worst <= 1, (speed, partner(speed), errors)
            tried += 1
    print(f"{tried} speeds on each wheel, {options.seconds:g} s each: worst error {worst:.3f} steps")
    return 0


if __name__ == "__main__":
    sys.exit(main())
