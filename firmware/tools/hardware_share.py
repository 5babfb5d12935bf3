"""Compute the share of hardware-specific lines in the kernel: `python firmware/tools/hardware_share.py [--json]`.

Two countings. Physical lines, comments and blanks included, as the paper counts: 489 of 2,783 lines, 17.6 %, without
I/O device implementations (openswarm-original.md §1). Code lines: without comments and blanks.
Hardware-specific is port/dspic30f; portable are kernel, options, interface and HAL contracts. Devices (io, board,
openswarm_io.h, hal_io.h, and hal_reset.h: the hardware watchdog) and the other ports are not counted. The set-up of
the board before any device (clock, configuration words, pins, interrupt entries, the list of devices: board.c, pins.h
and vectors.S of board/epuck) has its own line, because the paper does not say where it counts that set-up.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable
from pathlib import Path

OPENSWARM = Path(__file__).resolve().parents[1] / "openswarm"
SOURCE = {".c", ".h", ".S", ".inc"}
DEVICES = {"openswarm_io.h", "hal_io.h", "hal_reset.h"}
BOARD = ("board.c", "pins.h", "vectors.S")
PAPER_LINES, PAPER_SHARE = 489, 0.176
LARGEST_SHARE = 0.17
"""Exclusive upper bound of both shares."""


def physical(file: Path) -> int:
    """Count the lines of a file."""
    return file.read_text().count("\n")


def code(file: Path) -> int:
    """Count the lines of a file with code."""
    text = re.sub(r"/\*.*?\*/", "", file.read_text(), flags=re.DOTALL)
    line_comment = r";.*" if file.suffix in {".S", ".inc"} else r"//.*"
    return sum(bool(re.sub(line_comment, "", line).strip()) for line in text.splitlines())


def sources(*folders: str) -> list[Path]:
    """Return all sources in the folders except those of device drivers."""
    files = [file for folder in folders for file in sorted((OPENSWARM / folder).iterdir())]
    return [file for file in files if file.suffix in SOURCE and file.name not in DEVICES]


def count() -> dict[str, dict[str, float]]:
    """Return by counting method: hardware and portable lines, the hardware share, and lines of board set-up."""

    def counted(kind: str, files: Iterable[Path]) -> int:
        return sum((physical if kind == "physical" else code)(file) for file in files)

    found: dict[str, dict[str, float]] = {}
    for kind in ("physical", "code"):
        hardware = counted(kind, sources("port/dspic30f"))
        portable = counted(kind, sources("kernel", "option", "include", "hal"))
        board = counted(kind, (OPENSWARM / "board" / "epuck" / name for name in BOARD))
        share = hardware / (hardware + portable)
        found[kind] = {"hardware": hardware, "portable": portable, "share": share, "board": board}
    return found


def main() -> int:
    """Print the counts; return exit status 1 if a share is not below the bound."""
    found = count()
    if "--json" in sys.argv[1:]:
        print(json.dumps(found))
    else:
        for kind, n in found.items():
            total = n["hardware"] + n["portable"]
            print(f"{kind + ' lines':14} {n['hardware']:.0f} of {total:.0f} are hardware-specific: {n['share']:.1%}")
        print(f"board set-up   {found['physical']['board']:.0f} physical lines, {found['code']['board']:.0f} of code")
        print(f"paper          {PAPER_LINES} of 2783 physical lines: {PAPER_SHARE:.1%}")
    fine = found["physical"]["hardware"] < PAPER_LINES and all(n["share"] < LARGEST_SHARE for n in found.values())
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
