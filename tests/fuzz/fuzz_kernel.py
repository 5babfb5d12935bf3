"""Interrupts at every instruction boundary of a round of kernel calls: `python tests/fuzz/fuzz_kernel.py [--stride N]`.

The campaign behind tests/firmware/test_on_target.py, which samples. Builds the `points` firmware, then runs the round once a
boundary with tick, stepper and a sending device arriving there, without and with IPL slip (kernel.md §4).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.firmware.test_on_target import interrupt_every_boundary, start_of_scenario  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stride", type=int, default=1, help="try every N-th boundary only")
    stride = parser.parse_args().stride
    with tempfile.TemporaryDirectory() as out:
        words = ["APP=points", "APPS=../tests/firmware/target", f"OUT={out}", f"PYTHON={sys.executable}"]
        subprocess.run(["make", "-s", "-C", str(ROOT / "firmware"), *words], check=True)
        for ipl_slip in (0, 1):
            machine = start_of_scenario(Path(out) / "firmware.elf", ipl_slip)
            tried = interrupt_every_boundary(machine, stride, 0)
            print(f"ipl-slip {ipl_slip}: {tried} boundaries, nothing lost, doubled or leaked", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
