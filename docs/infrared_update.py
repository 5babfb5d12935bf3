"""Measures how a swarm reprograms itself by infra-red, on the real firmware in the arena, for docs/swarm.md.

    python docs/infrared_update.py [--robots 10] [--most 120] [--noise 2]

Robots of apps/spreading stand on the grid of infrared_swarm.py; the first has a program of one row. Printed is when
each has it whole, and when it has restarted and calls it. Exit status 1 if one does not within the `--most` seconds.
"""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
import sys

from infrared_swarm import grid, word

from arena.emulated import EmulatedBrain
from arena.ether import Ether
from arena.firmware import image_for
from arena.scene import FCY, load_scene
from emu.machine import Machine

VERSION = 2
"""The selector of the first robot, which is the version of its program."""
NO_STORE = 0xFF
"""Of `running` in io/update/update.c."""
LOOK_TICKS = 100


def calls_it(machine: Machine) -> bool:
    """Whether the program was called at the last start."""
    return bool(machine.record.bytes[machine.address_of("running")] != NO_STORE)


def measure(robots: int, most: float, noise: float) -> tuple[list[float], list[float]]:
    """Seconds after which each robot has the program, and calls it; in no order, less than all if some do not."""
    poses = grid(robots)
    values = {"robots__count": robots, "objects__count": 0, "infrared__noise_counts": noise}
    scene = load_scene("clustering").with_values(**values)
    ether = Ether.of(scene)
    image = image_for("spreading")
    assert image is not None
    brains = [EmulatedBrain(scene, 1, one, image, 0 if one else VERSION, ether) for one in range(robots)]
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
    parser.add_argument("--most", type=float, default=120.0, metavar="SECONDS")
    parser.add_argument("--noise", type=float, default=2.0, metavar="COUNTS")
    chosen = parser.parse_args()
    has, calls = measure(chosen.robots, chosen.most, chosen.noise)
    for what, seconds in (("have it whole", has), ("restarted and call it", calls)):
        known = seconds or [math.nan]
        times = f"median {statistics.median(known):.1f} s, last {max(known):.1f} s"
        print(f"{len(seconds)} of {chosen.robots} {what}: {times}")
    return 0 if len(calls) == chosen.robots else 1


if __name__ == "__main__":
    sys.exit(main())
