"""Measures messages between robots by infra-red, on the real firmware in the arena, for docs/swarm.md.

    python docs/tools/infrared_link.py [--seconds 3] [--noise 2] [--jobs 2] [--data docs/results/infrared-link.csv]

Two robots, of which both or one alone sends all the time, over distance and angle. The same arguments give the same
figures. infrared_published.py draws the data beside what SwarmCom and libIrcom have published. Of more robots:
infrared_swarm.py.
"""

from __future__ import annotations

import argparse
import csv
import math
import struct
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from arena.infrared.channel import OpticalChannel
from arena.infrared.propagation import amplitude
from arena.robots.firmware_controller import FirmwareController
from arena.robots.images import image_for
from arena.scene.loader import FCY, load_scene
from arena.world.physics import Poses
from emu.machine.machine import Machine

DISTANCES = (12.0, 18.0, 22.0, 25.0, 26.5, 28.0, 30.0, 32.0, 35.0)
"""cm between the middles; sensor 2 of one faces sensor 5 of the other."""
ANGLES = tuple(range(0, 360, 15))
"""Degrees by which the listener is turned."""
ANGLES_CM = 20.0
FIELDS = ("senders", "cm", "turned_deg", "noise_counts", "seconds", "sent", "arrived", "damaged", "repaired_bits")
"""Of the data file, one line per run."""
SENDERS, ENTRY, WORDS, CODE = 30, "<5Hih", 9, 15
"""Of firmware/apps/chatter: entries, one of them; words of a frame and their bits."""
SILENT = 15
"""Of firmware/apps/chatter: the selector of a robot that sends hardly anything, every 1.9 to 5.6 s."""
BEACONS = 1
"""Frames without a message that each robot sends, before it begins to talk."""
DAMAGED = 2
"""Place in sys_infrared_statistics."""
WARM_S = 0.5
"""Before they begin to talk."""


@dataclass(frozen=True)
class Job:
    """Robots `distance` cm apart, the second turned by `turned` degrees, and how many of both send."""

    senders: int
    distance: float
    turned: float
    seconds: float
    noise: float


@dataclass(frozen=True)
class Found:
    """Messages sent, arrivals, frames that arrived damaged, bits repaired in those that arrived whole."""

    sent: int
    arrived: int
    damaged: int
    repaired: int

    @property
    def share(self) -> float:
        return self.arrived / self.sent if self.sent else 0.0

    @property
    def bit_errors(self) -> float:
        """Per bit of the frames that arrived."""
        return self.repaired / max(self.arrived * WORDS * CODE, 1)


def measure(job: Job) -> Found:
    poses = facing(job.distance, job.turned)
    robots = len(poses.robots)
    values = {"robots__count": robots, "objects__count": 0, "infrared__noise_counts": job.noise}
    scene = load_scene("clustering").with_values(**values)
    channel = OpticalChannel.of(scene)
    image = image_for("chatter")
    assert image is not None
    selectors = [0 if number < job.senders else SILENT for number in range(robots)]
    controllers = [FirmwareController(scene, 1, number, image, selectors[number], channel) for number in range(robots)]
    for tick in range(math.ceil((WARM_S + job.seconds) * FCY / scene.clock.quantum_tcy)):
        for controller in controllers:
            controller.control_step(tick, poses)
    machines = [controller.machine for controller in controllers]
    senders = machines[: job.senders]
    sent = [_word(machine, "infrared_statistics") - BEACONS for machine in senders]
    numbers = [_word(machine, "infrared_number") for machine in senders]
    arrived = repaired = damaged = 0
    for machine in machines if job.senders > 1 else machines[1:]:
        damaged += struct.unpack("<7H", _bytes(machine, "infrared_statistics", 14))[DAMAGED]
        entries = _bytes(machine, "senders", SENDERS * struct.calcsize(ENTRY))
        for source, received, again, _, bits, _, _ in struct.iter_unpack(ENTRY, entries):
            if source in numbers:
                arrived, repaired = arrived + received - again, repaired + bits
    return Found(sum(sent), arrived, damaged, repaired)


def _word(machine: Machine, name: str) -> int:
    (found,) = struct.unpack("<H", _bytes(machine, name, 2))
    return int(found)


def _bytes(machine: Machine, name: str, size: int) -> bytes:
    at = machine.address_of(name)
    return bytes(machine.record.bytes[at : at + size])


def facing(distance: float, turned: float = 0.0) -> Poses:
    """Two robots: the first's right sensor towards the second's left one, the second turned by degrees."""
    return Poses([(150.0, 150.0, math.pi / 2), (150.0 + distance, 150.0, math.pi / 2 + math.radians(turned))], [])


def expected(distance: float, noise: float) -> tuple[float, float]:
    """Bit error rate of three scans, weighted 1-2-1, against half the amplitude; share of frames that are left."""
    deviation = noise * math.sqrt(6) / 4
    wrong = math.erfc(amplitude(distance) / (2 * deviation) / math.sqrt(2)) / 2
    word = (1 - wrong) ** CODE + CODE * wrong * (1 - wrong) ** (CODE - 1)
    return wrong, word**WORDS


def keep(path: Path, jobs: list[Job], found: list[Found]) -> None:
    """The data file: one line per run, under FIELDS."""
    with path.open("w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file, lineterminator="\n")
        lines.writerow(FIELDS)
        for job, one in zip(jobs, found, strict=True):
            about = (job.senders, f"{job.distance:g}", f"{job.turned:g}", f"{job.noise:g}", f"{job.seconds:g}")
            lines.writerow((*about, one.sent, one.arrived, one.damaged, one.repaired))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--noise", type=float, default=2.0, metavar="COUNTS")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--data", type=Path, help="CSV file to write, for infrared_published.py")
    chosen = parser.parse_args()
    image_for("chatter")  # built once
    runs = [(2, one, 0.0) for one in DISTANCES] + [(1, one, 0.0) for one in DISTANCES]
    runs += [(1, ANGLES_CM, float(one)) for one in ANGLES]
    jobs = [Job(*one, chosen.seconds, chosen.noise) for one in runs]
    if chosen.jobs > 1:
        with ProcessPoolExecutor(chosen.jobs) as pool:
            found = list(pool.map(measure, jobs))
    else:
        found = [measure(job) for job in jobs]
    print("senders   cm  deg   sent arrived damaged  share  repaired/bit  expected: bits  frames")
    for job, one in zip(jobs, found, strict=True):
        wrong, frames = expected(job.distance, chosen.noise)
        seen = f"{one.sent:6} {one.arrived:7} {one.damaged:7} {one.share:6.2f} {one.bit_errors:13.1e}"
        print(f"{job.senders:7} {job.distance:4g} {job.turned:4g} {seen} {wrong:15.1e} {frames:7.2f}")
    if chosen.data is not None:
        keep(chosen.data, jobs, found)


if __name__ == "__main__":
    main()
