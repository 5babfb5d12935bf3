"""Engines against each other: random (instruction, context) pairs and random programs, the whole state compared.

Run `python tests/fuzz/fuzz_engines.py [--pairs N] [--programs N] [--seed S] [--engine NAME]`; exits 1 at the first
difference, with what is needed to reproduce it.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "emu" / "cpu")]

from engine_fuzz import Difference, check_pairs, check_programs  # noqa: E402

CONTEXTS = 20
"""Contexts per instruction."""
BATCH = 500
"""Instructions or programs per seed."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=1_000_000, help="instructions x contexts (default %(default)s)")
    parser.add_argument("--programs", type=int, default=5_000, help="random programs (default %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="first seed (default %(default)s)")
    parser.add_argument("--engine", default="interp", help="engine to compare with the plain one (default %(default)s)")
    options = parser.parse_args()
    start, seed, pairs, programs, cycles = time.perf_counter(), options.seed, 0, 0, 0
    try:
        while pairs < options.pairs:
            pairs += check_pairs(seed, min(BATCH, -(-(options.pairs - pairs) // CONTEXTS)), CONTEXTS, options.engine)
            seed += 1
            if seed % 10 == 0:
                print(f"{pairs} pairs, no difference so far", flush=True)
        while programs < options.programs:
            count = min(BATCH, options.programs - programs)
            cycles += check_programs(seed, count, options.engine)
            programs += count
            seed += 1
    except Difference as difference:
        print(f"DIFFERENCE: {difference}")
        return 1
    spent = time.perf_counter() - start
    print(f"{pairs} pairs and {programs} programs ({cycles} cycles), no difference, {spent:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
