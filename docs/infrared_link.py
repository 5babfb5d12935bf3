"""Measures messages between robots by infra-red, on the real firmware in the arena, for docs/swarm.md.

    python docs/infrared_link.py [--seconds 3] [--noise 2] [--jobs 2] [--figure docs/figures/infrared-link.png]

Two robots that send all the time, over distance and angle. The same arguments give the same figures. Of more robots:
infrared_swarm.py.
"""

from __future__ import annotations

import argparse
import math
import struct
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from arena.emulated import EmulatedBrain
from arena.ether import Ether
from arena.firmware import image_for
from arena.optics import amplitude
from arena.scene import FCY, load_scene
from arena.world import Poses

DISTANCES = (12.0, 18.0, 22.0, 25.0, 28.0, 30.0, 32.0, 35.0)
"""cm between the middles; sensor 2 of one faces sensor 5 of the other."""
ANGLES = tuple(range(0, 360, 30))
"""Degrees by which one of them is turned, at 15 cm."""
SENDERS, ENTRY, WORDS, CODE = 30, "<5Hih", 9, 15
"""Of firmware/apps/chatter: entries, one of them; words of a frame and their bits."""
BEACONS = 1
"""Frames without a message that each robot sends, before it begins to talk."""
WARM_S = 0.5
"""Before they begin to talk."""


@dataclass(frozen=True)
class Job:
    poses: Poses
    seconds: float
    noise: float


@dataclass(frozen=True)
class Found:
    """Frames sent, arrivals, bits repaired."""

    sent: int
    arrived: int
    repaired: int

    @property
    def share(self) -> float:
        return self.arrived / self.sent if self.sent else 0.0

    @property
    def bit_errors(self) -> float:
        """Per bit of the frames that arrived."""
        return self.repaired / max(self.arrived * WORDS * CODE, 1)


def measure(job: Job) -> Found:
    robots = len(job.poses.robots)
    values = {"robots__count": robots, "objects__count": 0, "infrared__noise_counts": job.noise}
    scene = load_scene("clustering").with_values(**values)
    ether = Ether.of(scene)
    image = image_for("chatter")
    assert image is not None
    brains = [EmulatedBrain(scene, 1, number, image, 0, ether) for number in range(robots)]
    for tick in range(math.ceil((WARM_S + job.seconds) * FCY / scene.clock.quantum_tcy)):
        for brain in brains:
            brain.think(tick, job.poses)
    machines = [brain.machine for brain in brains]
    sent = [struct.unpack("<H", _bytes(machine, "infrared_statistics", 2))[0] - BEACONS for machine in machines]
    numbers = [struct.unpack("<H", _bytes(machine, "infrared_number", 2))[0] for machine in machines]
    arrived = repaired = 0
    for machine in machines:
        entries = _bytes(machine, "senders", SENDERS * struct.calcsize(ENTRY))
        for source, received, again, _, bits, _, _ in struct.iter_unpack(ENTRY, entries):
            if source in numbers:
                arrived, repaired = arrived + received - again, repaired + bits
    return Found(sum(sent), arrived, repaired)


def _bytes(machine, name: str, size: int) -> bytes:
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


def draw(path: Path, far: list[Found], around: list[Found], noise: float) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4))
    fine = [DISTANCES[0] + (DISTANCES[-1] - DISTANCES[0]) * step / 200 for step in range(201)]
    left.plot(fine, [expected(one, noise)[1] for one in fine], "k-", lw=1, label="frames, if only bits fail")
    left.plot(fine, [expected(one, noise)[0] for one in fine], "k:", lw=1, label="bit errors, Q(A / 2 sigma)")
    left.plot(DISTANCES, [one.share for one in far], "o-", color="tab:blue", label="frames that arrived")
    left.plot(DISTANCES, [one.bit_errors for one in far], "s--", color="tab:red", label="bits repaired in them")
    left.set(xlabel="cm between the middles", ylabel="share", title=f"facing, noise {noise:g} counts")
    left.legend(fontsize=8)
    right.plot(ANGLES, [one.share for one in around], "o-", color="tab:blue")
    right.set(xlabel="one turned by, degrees", ylabel="frames that arrived", title="15 cm", ylim=(-0.05, 1.05))
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--noise", type=float, default=2.0, metavar="COUNTS")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--figure", type=Path)
    chosen = parser.parse_args()
    image_for("chatter")  # built once
    poses = [facing(one) for one in DISTANCES] + [facing(15.0, one) for one in ANGLES]
    jobs = [Job(one, chosen.seconds, chosen.noise) for one in poses]
    with ProcessPoolExecutor(chosen.jobs) as pool:
        found = list(pool.map(measure, jobs))
    far, around = found[: len(DISTANCES)], found[len(DISTANCES) :]
    print("cm    sent arrived  share  repaired/bit  expected: bits  frames")
    for distance, one in zip(DISTANCES, far, strict=True):
        wrong, frames = expected(distance, chosen.noise)
        seen = f"{distance:4.0f} {one.sent:5} {one.arrived:7} {one.share:6.2f} {one.bit_errors:13.1e}"
        print(f"{seen} {wrong:15.1e} {frames:7.2f}")
    print("deg   sent arrived  share")
    for angle, one in zip(ANGLES, around, strict=True):
        print(f"{angle:4} {one.sent:5} {one.arrived:7} {one.share:6.2f}")
    if chosen.figure is not None:
        draw(chosen.figure, far, around, chosen.noise)


if __name__ == "__main__":
    main()
