"""Share of hardware-specific lines in the kernel: `python firmware/tools/hardware_share.py [--json]`.

Physical lines, comments and blanks included, as the paper counts: 489 of 2,783 lines, 17.6 %, without I/O device
implementations (openswarm-original.md §1). Hardware-specific is port/dspic30f; portable are kernel, interface and
HAL contracts. Devices (io, board, openswarm_io.h, hal_io.h) and the other ports are not counted at all.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

OPENSWARM = Path(__file__).resolve().parents[1] / "openswarm"
SOURCE = {".c", ".h", ".S", ".inc"}
DEVICES = {"openswarm_io.h", "hal_io.h"}
PAPER_LINES, PAPER_SHARE = 489, 0.176


def lines(*folders: str) -> int:
    """Physical lines of all sources in the folders, devices left out."""
    files = [file for folder in folders for file in sorted((OPENSWARM / folder).iterdir())]
    return sum(file.read_text().count("\n") for file in files if file.suffix in SOURCE and file.name not in DEVICES)


def count() -> dict[str, float]:
    """hardware and portable lines, and the share of the first in their sum."""
    hardware, portable = lines("port/dspic30f"), lines("kernel", "include", "hal")
    return {"hardware": hardware, "portable": portable, "share": hardware / (hardware + portable)}


def main() -> int:
    """Print the count. Exit status 1 if it is not below the paper's."""
    found = count()
    if "--json" in sys.argv[1:]:
        print(json.dumps(found))
    else:
        total = found["hardware"] + found["portable"]
        print(f"{found['hardware']:.0f} of {total:.0f} lines are hardware-specific: {found['share']:.1%}")
        print(f"paper: {PAPER_LINES} of 2783, {PAPER_SHARE:.1%}")
    return 0 if found["hardware"] < PAPER_LINES and found["share"] < PAPER_SHARE else 1


if __name__ == "__main__":
    sys.exit(main())
