"""Camera HREF edges at every cycle: `python tests/fuzz/kernel/fuzz_camera.py [--rounds N] [--stride N] [--seconds
T]`.

A sample of this campaign is tests/firmware/camera/test_camera_on_target.py. A round executes every kernel and device
call with all interrupts enabled, with IPL slip if the seed is odd, and moves the HREF edge over all cycles: about
25,000 lines, each of which must be captured without a wrong byte. With --stride a round tests every N-th cycle, from
a first one that depends on its seed.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.firmware.capture_sweep import start, sweep  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

SPARSE = 499
"""Default stride if the duration is limited by --seconds."""


def main() -> int:
    campaign = Campaign(parser(__doc__), "rounds", 2, "rounds of calls")
    campaign.parser.add_argument("--stride", type=int, help=f"every N-th cycle (default 1; {SPARSE} with --seconds)")
    options = campaign.parse()
    stride = options.stride or (1 if options.seconds is None else SPARSE)
    tried = 0
    with tempfile.TemporaryDirectory() as folder:
        words = ["APP=capture", "APPS=../tests/firmware/target", f"OUT={folder}", f"PYTHON={sys.executable}"]
        subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), *words], check=True)
        for seed in campaign:
            picture = np.random.default_rng(seed).integers(0, 256, (480, 640, 3), dtype=np.uint8)
            try:
                tried += sweep(start(Path(folder) / "firmware.elf", picture, seed % 2), picture, stride, seed % stride)
            except AssertionError as error:
                return campaign.failed(error)
    return campaign.ended(f"HREF on {tried} cycles, every pixel right")


if __name__ == "__main__":
    sys.exit(main())
