"""Measure infrared messages among 2, 10 and 30 robots with the real firmware in the arena, for docs/swarm.md.

    python docs/tools/infrared/swarm.py [--seconds 5] [--noise 2] [--jobs 2]

The robots are on a triangular grid with a spacing of 11 cm and different headings. Each sends a message of eight bytes
every 0.75 to 2.25 s. Every run is made twice; the exit status is 1 if the two results differ in any byte.
"""

from __future__ import annotations

import argparse
import hashlib
import math
import struct
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

from arena.infrared.channel import OpticalChannel
from arena.infrared.propagation import Optics
from arena.robots.firmware_controller import FirmwareController
from arena.robots.images import image_for
from arena.scene.loader import FCY, load_scene
from arena.world.poses import Poses
from emu.machine.machine import Machine

SWARMS = (2, 10, 30)
SPACING_CM = 11.0
ROW = 6
"""Maximum number of robots in a row of the grid."""
REACH_COUNTS = 8.0
"""Counts of light from another robot's emitters at which that robot is in reach.

They correspond to about 27 cm between a sensor and an emitter that face each other. At this distance most frames of two
undisturbed robots still arrive (docs/tools/infrared/link.py).
"""
SELECTOR = 6
"""Selector of apps/chatter: a message every 0.75 to 2.25 s."""
SENDERS, ENTRY = 30, "<5Hih"
"""Constants of apps/chatter: number of entries in `senders` and format of an entry."""
COLUMNS = ("robots", "in reach of each", "sent", "could arrive", "share delivered", "lost", "from beyond reach",
           "twice", "ms, mean", "most")  # fmt: skip
WARM_S = 0.5
"""Seconds before the robots send their first message."""


@dataclass(frozen=True)
class SwarmResult:
    """Result for a swarm."""

    robots: int
    reached: float
    """Mean number of robots in reach of a robot."""
    sent: int
    """Messages sent."""
    possible: int
    """Receptions that are possible in reach."""
    arrived: int
    """Receptions in reach."""
    beyond: int
    """Receptions from senders out of reach."""
    twice: int
    """Messages that a robot received more than once."""
    ms: float
    """Mean time in ms from queueing to the handler."""
    most_ms: int
    """Maximum of that time."""
    everything: str
    """Hash of all counters."""


def grid(robots: int) -> Poses:
    """Return robots in rows of equal length; every second row is shifted by half the spacing."""
    columns = min(robots, ROW if robots > ROW * 2 else math.ceil(robots / 3) if robots > 2 else robots)
    places = [(number % columns, number // columns) for number in range(robots)]
    return Poses(
        [
            (100 + SPACING_CM * (column + row % 2 / 2), 100 + SPACING_CM * row * math.sqrt(3) / 2, 1.7 * number)
            for number, (column, row) in enumerate(places)
        ],
        [],
    )


def measure(robots: int, seconds: float, noise: float) -> SwarmResult:
    poses = grid(robots)
    values = {"robots__count": robots, "objects__count": 0, "infrared__noise_counts": noise}
    scene = load_scene("clustering").with_values(**values)
    channel = OpticalChannel.of(scene)
    image = image_for("chatter")
    assert image is not None
    controllers = [FirmwareController(scene, 1, number, image, SELECTOR, channel) for number in range(robots)]
    for tick in range(math.ceil((WARM_S + seconds) * FCY / scene.clock.quantum_tcy)):
        for controller in controllers:
            controller.control_step(tick, poses)
    machines = [controller.machine for controller in controllers]
    clocks, numbers = ([word(one, name) for one in machines] for name in ("now_ms", "infrared_number"))
    sent = [word(one, "mine") - _bytes(one, "queue_length", 1)[0] for one in machines]
    optics = Optics(scene)
    digest = hashlib.sha256()
    possible = arrived = beyond = twice = total = most = pairs = 0
    for me, machine in enumerate(machines):
        signals = optics.signals(poses, me, [other for other in range(robots) if other != me])
        near = {one.robot for one in signals if sum(one.counts) * max(one.shares) >= REACH_COUNTS}
        pairs += len(near)
        possible += sum(sent[other] for other in near)
        entries = _bytes(machine, "senders", SENDERS * struct.calcsize(ENTRY))
        digest.update(entries + _bytes(machine, "infrared_statistics", 2))
        for source, received, again, _, _, ms, longest in struct.iter_unpack(ENTRY, entries):
            if source not in numbers:
                continue
            other = numbers.index(source)
            late = (clocks[me] - clocks[other] + 0x8000) % 0x10000 - 0x8000  # the clocks' difference in ms
            new = received - again
            arrived, beyond = (arrived + new, beyond) if other in near else (arrived, beyond + new)
            twice, total, most = twice + again, total + ms - received * late, max(most, longest - late)
    return SwarmResult(
        robots, pairs / robots, sum(sent), possible, arrived, beyond, twice, total / max(arrived + beyond + twice, 1),
        most, digest.hexdigest(),
    )  # fmt: skip


def word(machine: Machine, name: str) -> int:
    """Return a 16-bit variable, or the first one of a structure."""
    (value,) = struct.unpack("<H", _bytes(machine, name, 2))
    return int(value)


def _bytes(machine: Machine, name: str, size: int) -> bytes:
    at = machine.address_of(name)
    return bytes(machine.record.bytes[at : at + size])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--noise", type=float, default=2.0, metavar="COUNTS")
    parser.add_argument("--jobs", type=int, default=2)
    chosen = parser.parse_args()
    image_for("chatter")  # build the image once, before the processes start
    with ProcessPoolExecutor(chosen.jobs) as pool:
        runs = [pool.submit(measure, robots, chosen.seconds, chosen.noise) for robots in SWARMS for _ in range(2)]
    found = [one.result() for one in runs]
    print("| " + " | ".join(COLUMNS) + " |")
    print("|---" * len(COLUMNS) + "|")
    for one in found[::2]:
        shares = f"{one.arrived / max(one.possible, 1):.2f} | {one.possible - one.arrived}"
        print(
            f"| {one.robots} | {one.reached:.1f} | {one.sent} | {one.possible} | {shares} | {one.beyond} |"
            f" {one.twice} | {one.ms:.0f} | {one.most_ms} |"
        )
    if found[::2] != found[1::2]:
        print("the second run of each differs from the first", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
