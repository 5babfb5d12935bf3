"""Engines against each other on random programs that live on device registers; the whole state is compared.

Run `python tests/fuzz/fuzz_devices.py [--programs N] [--seed S] [--engine NAME]`; exits 1 at the first difference.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "emu")]

from peripherals.device_programs import difference  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", type=int, default=150, help="random programs (default %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="first seed (default %(default)s)")
    parser.add_argument("--engine", default="jit", help="engine to compare with the plain one (default %(default)s)")
    options = parser.parse_args()
    start = time.perf_counter()
    for seed in range(options.seed, options.seed + options.programs):
        found = difference(seed, options.engine, chunks=6)
        if found is not None:
            print(found)
            return 1
    print(f"{options.programs} programs on {options.engine}, {time.perf_counter() - start:.0f} s, no difference")
    return 0


if __name__ == "__main__":
    sys.exit(main())
