"""Compare all 2**24 first words with SLEIGH and print the classes of disagreement, as in docs/census.md.

Run from the repository's top folder: ``python tests/fuzz/emulator/census_sleigh.py``. About five minutes on one core.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

from emu.dspic30f.isa import codec

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))


def main() -> int:
    from tests.emu.isa.sleigh import disagreement  # tests/emu/isa/sleigh.py

    classes: Counter[str] = Counter()
    example: dict[str, int] = {}
    for word in range(1 << 24):
        if not word & 0xFFFF:
            codec.decode.cache_clear()
            codec.decode_loosely.cache_clear()
        name = disagreement(word)
        if name is not None:
            classes[name] += 1
            example.setdefault(name, word)
    print("| class | words | first |\n|---|---|---|")
    for name, count in sorted(classes.items()):
        print(f"| {name} | {count:,} | {example[name]:06x} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
