"""The camera's HREF on every cycle: `python tests/fuzz/fuzz_camera.py [--stride N]`.

The campaign behind tests/firmware/test_camera_on_target.py, which samples: a round of every kernel and device call with
all interrupts running, without and with IPL slip; every line must be right to the byte. Some 25,000 lines each.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.firmware.sights import start, sweep  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stride", type=int, default=1, help="try every N-th cycle (default 1)")
    parser.add_argument("--seed", type=int, default=1, help="of the picture")
    options = parser.parse_args()
    picture = np.random.default_rng(options.seed).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    with tempfile.TemporaryDirectory() as folder:
        words = ["APP=sights", "APPS=../tests/firmware/target", f"OUT={folder}", f"PYTHON={sys.executable}"]
        subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), *words], check=True)
        for ipl_slip in (0, 1):
            machine = start(Path(folder) / "firmware.elf", picture, ipl_slip)
            tried = sweep(machine, picture, options.stride)
            print(f"ipl-slip {ipl_slip}: HREF on {tried} cycles of a round, every pixel right", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
