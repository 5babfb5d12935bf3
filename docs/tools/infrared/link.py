"""Measure infrared messages between two robots with the real firmware in the arena, for docs/swarm.md.

    python docs/tools/infrared/link.py [--seconds 3] [--noise 2] [--jobs 2] [--data docs/results/infrared-link.csv]

One robot or both send continuously, at several distances and angles. The same arguments give the same figures.
published.py draws the data together with the published values of SwarmCom and libIrcom. swarm.py measures larger
swarms.
"""

from __future__ import annotations

import argparse
import csv
import math
import struct
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from arena.infrared.channel import OpticalChannel
from arena.infrared.propagation import amplitude, brightest
from arena.robots.firmware_controller import FirmwareController
from arena.robots.images import image_for
from arena.scene.loader import FCY, load_scene
from arena.world.poses import Poses
from emu.machine.machine import Machine

DISTANCES = (12.0, 18.0, 22.0, 25.0, 26.5, 28.0, 30.0, 32.0, 35.0)
"""Distances between the robots' centres in cm; sensor 2 of one robot faces sensor 5 of the other."""
ANGLES = tuple(range(0, 360, 15))
"""Angles in degrees by which the receiver is turned."""
ANGLES_CM = 20.0
FIELDS = ("senders", "cm", "turned_deg", "noise_counts", "seconds", "sent", "arrived", "damaged", "repaired_bits")
"""Columns of the data file, which has one line per run."""
SENDERS, ENTRY, WORDS, CODE = 30, "<5Hih", 9, 15
"""Constants of firmware/apps/chatter: number of entries in `senders`, format of an entry, words of a frame, bits of a
coded word."""
SILENT = 15
"""Selector of firmware/apps/chatter for a robot that sends only every 1.9 to 5.6 s."""
BEACONS = 1
"""Number of frames without a message that each robot sends before its first message."""
DAMAGED = 2
"""Index of the damaged frames in sys_infrared_statistics."""
PHASES = 200
"""Phases between the scans of two robots over which `expected` averages."""
SCAN_US = 1e6 / 4096
"""Time between two scans (docs/design/infrared.md)."""
WARM_S = 0.5
"""Seconds before the robots send their first message."""


@dataclass(frozen=True)
class Job:
    """Parameters of a run: number of senders (1 or 2), distance in cm, angle in degrees by which the second robot is
    turned, seconds, and noise in counts."""

    senders: int
    distance: float
    turned: float
    seconds: float
    noise: float


@dataclass(frozen=True)
class LinkResult:
    """Result of a run: messages sent, messages received, frames received with damage, and bits repaired in intact
    frames."""

    sent: int
    arrived: int
    damaged: int
    repaired: int

    @property
    def share(self) -> float:
        return self.arrived / self.sent if self.sent else 0.0

    @property
    def bit_errors(self) -> float:
        """Return the repaired bits per bit of the received frames."""
        return self.repaired / max(self.arrived * WORDS * CODE, 1)


def measure(job: Job) -> LinkResult:
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
    return LinkResult(sum(sent), arrived, damaged, repaired)


def _word(machine: Machine, name: str) -> int:
    (found,) = struct.unpack("<H", _bytes(machine, name, 2))
    return int(found)


def _bytes(machine: Machine, name: str, size: int) -> bytes:
    at = machine.address_of(name)
    return bytes(machine.record.bytes[at : at + size])


def facing(distance: float, turned: float = 0.0) -> Poses:
    """Return poses of two robots: the first's right sensor faces the second's left one.

    The second robot is turned by `turned` degrees.
    """
    return Poses([(150.0, 150.0, math.pi / 2), (150.0 + distance, 150.0, math.pi / 2 + math.radians(turned))], [])


class Expected(NamedTuple):
    """Expected errors of a receiver that has found the preamble.

    `repaired` is the number of repaired bits per bit of intact frames; `low` and `high` are its 10 and 90 % quantiles
    over the phases. `intact` is the share of intact frames, `ideal` the bit error rate without transitions of light.
    """

    repaired: float
    low: float
    high: float
    intact: float
    ideal: float


def expected(distance: float, noise: float) -> Expected:
    """Return the expected errors between robots that face each other with one emitter and one sensor.

    The receiver compares three scans, weighted 1-2-1, with half the amplitude of one emitter. Half of the bits begin
    with a transition, and the receiver is then still settling in the first scan. The error depends on the phase between
    the scans of both robots, which is random but constant in a frame.
    """
    scene = load_scene("clustering").infrared
    counts, deviation = amplitude(distance) / brightest(scene.emitter_power), noise * math.sqrt(6) / 4
    ideal = _tail(counts / 2 / deviation)
    rates, shares = [], []
    for phase in range(PHASES):
        unsettled = math.exp(-(phase + 0.5) / PHASES * SCAN_US / scene.tau_us)
        wrong = (ideal + _tail((counts / 2 - counts / 4 * unsettled) / deviation)) / 2
        single = CODE * wrong * (1 - wrong) ** (CODE - 1)
        word = (1 - wrong) ** CODE + single
        rates.append(single / word / CODE)
        shares.append(word**WORDS)
    repaired = sum(rate * share for rate, share in zip(rates, shares, strict=True)) / sum(shares)
    ordered = sorted(rates)
    return Expected(repaired, ordered[PHASES // 10], ordered[-1 - PHASES // 10], sum(shares) / PHASES, ideal)


def _tail(deviations: float) -> float:
    """Return the probability that a normal variable is more than this many standard deviations above its mean."""
    return math.erfc(deviations / math.sqrt(2)) / 2


def keep(path: Path, jobs: list[Job], found: list[LinkResult]) -> None:
    """Write the data file: one line per run, with the columns FIELDS."""
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
    parser.add_argument("--data", type=Path, help="CSV file to write, for published.py")
    chosen = parser.parse_args()
    image_for("chatter")  # build the image once, before the processes start
    runs = [(2, one, 0.0) for one in DISTANCES] + [(1, one, 0.0) for one in DISTANCES]
    runs += [(1, ANGLES_CM, float(one)) for one in ANGLES]
    jobs = [Job(*one, chosen.seconds, chosen.noise) for one in runs]
    if chosen.jobs > 1:
        with ProcessPoolExecutor(chosen.jobs) as pool:
            found = list(pool.map(measure, jobs))
    else:
        found = [measure(job) for job in jobs]
    print("senders   cm  deg   sent arrived damaged  share  repaired/bit  expected: bits  10 to 90 % of phases  frames")
    for job, one in zip(jobs, found, strict=True):
        model = expected(job.distance, chosen.noise)
        seen = f"{one.sent:6} {one.arrived:7} {one.damaged:7} {one.share:6.2f} {one.bit_errors:13.1e}"
        spread = f"{model.low:.1e} to {model.high:.1e}"
        print(f"{job.senders:7} {job.distance:4g} {job.turned:4g} {seen} {model.repaired:15.1e} {spread:>24} "
              f"{model.intact:7.2f}")  # fmt: skip
    if chosen.data is not None:
        keep(chosen.data, jobs, found)


if __name__ == "__main__":
    main()
