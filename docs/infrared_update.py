"""Measures how a swarm reprograms itself by infra-red, on the real firmware in the arena, for docs/swarm.md.

    python docs/infrared_update.py [--robots 10] [--rows 1] [--lost 0] [--most 120] [--noise 2]

Robots of apps/spreading stand on the grid of infrared_swarm.py; the first has a program of so many rows. Printed is
when each has it whole, and when it has restarted and calls it. Exit status 1 if one does not within `--most` seconds.
"""

from __future__ import annotations

import argparse
import itertools
import math
import random
import statistics
import sys
import zlib

from infrared_swarm import grid, word

from arena.emulated import EmulatedBrain
from arena.ether import Ether
from arena.firmware import image_for
from arena.scene import FCY, load_scene
from emu.loader import load_image
from emu.machine import Machine
from openswarm.flashing.program import ROWS, program_of

VERSION = 2
"""The selector of the first robot, which is the version of its program."""
NO_STORE = 0xFF
"""Of `running` in io/update/update.c."""
LOOK_TICKS = 100
STORE, ROW_UNITS, ROW_BYTES = 0x016800, 64, 96
"""The first store of a robot (board/epuck/update/update_slots.h), and its rows."""
MARK, FACTS = 0xA7, 8
"""Of its head (io/update/update.c)."""


def calls_it(machine: Machine) -> bool:
    """Whether the program was called at the last start."""
    return bool(machine.record.bytes[machine.address_of("running")] != NO_STORE)


def store(machine: Machine, rows: list[bytes]) -> None:
    """Put a program into a robot, as if it had received it."""
    crc = zlib.crc32(b"".join(rows))
    facts = bytes([MARK]) + VERSION.to_bytes(2, "little") + bytes([len(rows)]) + crc.to_bytes(4, "little")
    head = facts + bytes(~byte & 0xFF for byte in facts)
    for number, row in enumerate([head.ljust(ROW_BYTES, b"\xff"), *rows]):
        words = [int.from_bytes(row[at : at + 3], "little") for at in range(0, ROW_BYTES, 3)]
        machine.program.put_flash(STORE + number * ROW_UNITS, words)


def measure(robots: int, rows: int, lost: float, most: float, noise: float) -> tuple[list[float], list[float]]:
    """Seconds after which each robot has the program, and calls it; in no order, less than all if some do not."""
    poses = grid(robots)
    values = {"robots__count": robots, "objects__count": 0, "infrared__noise_counts": noise,
              "infrared__lost_share": lost}  # fmt: skip
    scene = load_scene("clustering").with_values(**values)
    ether = Ether.of(scene)
    image = image_for("spreading")
    assert image is not None
    brains = [EmulatedBrain(scene, 1, one, image, 0 if one else VERSION, ether) for one in range(robots)]
    lamp = program_of(load_image(str(image.with_name("lamp.elf")))).rows
    filling = [random.Random(number).randbytes(ROW_BYTES) for number in range(len(lamp), rows)]
    store(brains[0].machine, [*lamp, *filling])
    has, calls = dict[int, float](), dict[int, float]()
    for tick in itertools.count(1):
        for brain in brains:
            brain.think(tick - 1, poses)
        if tick % LOOK_TICKS:
            continue
        seconds = tick * scene.clock.quantum_tcy / FCY
        for one, brain in enumerate(brains):
            if word(brain.machine, "have") == VERSION:
                has.setdefault(one, seconds)
            if one in has and calls_it(brain.machine):
                calls.setdefault(one, seconds)
        if len(calls) == robots or seconds >= most:
            break
    return list(has.values()), list(calls.values())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=10)
    parser.add_argument("--rows", type=int, default=1, choices=range(1, ROWS + 1), metavar="N")
    parser.add_argument("--lost", type=float, default=0.0, metavar="SHARE", help="of messages, beside the light's own")
    parser.add_argument("--most", type=float, default=120.0, metavar="SECONDS")
    parser.add_argument("--noise", type=float, default=2.0, metavar="COUNTS")
    chosen = parser.parse_args()
    has, calls = measure(chosen.robots, chosen.rows, chosen.lost, chosen.most, chosen.noise)
    for what, seconds in (("have it whole", has), ("restarted and call it", calls)):
        known = seconds or [math.nan]
        times = f"median {statistics.median(known):.1f} s, last {max(known):.1f} s"
        print(f"{len(seconds)} of {chosen.robots} {what}: {times}")
    return 0 if len(calls) == chosen.robots else 1


if __name__ == "__main__":
    sys.exit(main())
