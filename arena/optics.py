"""Infrared light from robot to robot: strength by distance, by the angles of emitter and receiver, and what is between.

The only published measurement between e-pucks is libIrcom's table of amplitudes by distance (swarmcom.md §3.1). The
shape of the beams is assumed (§7). Distances and angles are those of the line between the robots' centres, as the
published calibration takes them; only robots that touch would notice a difference. Nothing here depends on time:
`ether.py` knows what is lit, `infrared.py` adds it up.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache
from typing import Final, NamedTuple

import numpy as np

from arena import bodies, geometry
from arena.scene import Scene
from arena.world import Poses
from emu.boards.epuck.analog import PULSE_PINS

PUBLISHED: Final = (
    (7.5, 3534.0), (8.0, 2104.0), (8.5, 1135.0), (9.0, 702.0), (9.5, 509.0), (10.0, 376.0), (10.5, 305.0),
    (11.0, 264.0), (11.5, 207.0), (12.0, 167.0), (12.5, 137.0), (13.0, 113.0), (13.5, 91.6), (14.0, 79.2),
    (14.5, 69.4), (15.0, 66.1), (15.5, 51.4), (16.0, 44.0), (16.5, 38.5), (17.0, 35.0), (17.5, 31.7), (18.0, 28.0),
    (18.5, 25.9), (19.0, 23.4), (19.5, 22.0), (20.0, 20.0), (20.5, 18.3), (21.0, 17.1), (21.5, 16.1), (22.0, 14.6),
)  # fmt: skip
"""libIrcom's table: distance of the centres in cm (UNVERIFIED: inferred from the first entry, robots that touch), and
counts between dark and lit (swarmcom.md §3.1)."""
LAW_COUNTS, LAW_FROM_CM, LAW_POWER = 10_269.0, 6.0, -2.354
"""A(d) = 10269 (d - 6)^-2.354, fitted to that table: 6.3 % (swarmcom.md §3.1). UNVERIFIED beyond 22 cm."""
MOST_COUNTS: Final = 3500.0
"""No robot takes off more: the table saturates there (swarmcom.md §3.1)."""
LEAST_COUNTS: Final = 0.1
"""Weaker senders are left out, those farther than 140 cm: all robots of a swarm together would not make a count."""
_LINES: Final = len(PULSE_PINS)
_BEARINGS: Final = tuple(math.radians(bearing) for bearing in bodies.IR_BEARINGS_DEG)


class Signal(NamedTuple):
    """What a robot can get of another's light: counts of each pulse line on a sensor that faces it, times the sensor's
    share."""

    robot: int
    counts: tuple[float, ...]
    shares: tuple[float, ...]


def amplitude(distance_cm: float) -> float:
    """Counts between dark and lit: all emitters of a robot, seen by one that faces it, their centres so far apart."""
    beyond = distance_cm - LAW_FROM_CM
    return min(LAW_COUNTS * float(beyond**LAW_POWER), MOST_COUNTS) if beyond > 0 else MOST_COUNTS


def distance_of(counts: float) -> float:
    """Where the amplitude is so much, in cm: the inverse."""
    return LAW_FROM_CM + float((counts / LAW_COUNTS) ** (1 / LAW_POWER))


def beam(towards: float, power: float) -> list[float]:
    """Shares of the eight emitters or receivers for light in a direction, rad counter-clockwise from the robot's
    front."""
    return [max(math.cos(towards + bearing), 0.0) ** power for bearing in _BEARINGS]


@cache
def brightest(power: float) -> float:
    """All emitters together in their best direction, between two neighbours: what the law's amplitude belongs to."""
    return max(sum(beam(math.radians(degrees / 4), power)) for degrees in range(4 * 360))


class Optics:
    """A scene as light sees it."""

    def __init__(self, scene: Scene) -> None:
        setting = scene.infrared
        self._emitter, self._receiver = setting.emitter_power, setting.receiver_power
        self._gain = setting.signal_gain
        self._per_emitter = 1 / brightest(setting.emitter_power)
        self._objects = [scene.kind_of(number).radius_cm for number in range(scene.objects.count)]
        fixed = [(one.x_cm, one.y_cm, one.radius_cm) for one in scene.obstacles if one.radius_cm]
        self._fixed = np.array([one[:2] for one in fixed]).reshape(-1, 2)
        self._fixed_radii = [one[2] for one in fixed]
        shapes = [scene.arena.polygon, *(one.polygon for one in scene.obstacles)]
        self._sides = [side for shape in shapes if shape for side in geometry.sides(shape)]

    def signals(self, poses: Poses, robot: int, others: Iterable[int]) -> list[Signal]:
        """What a robot can get of the light of others, of those of whom it gets any."""
        x, y, heading = poses.robots[robot]
        found: list[Signal] = []
        strong = [(other, self._gain * amplitude(math.dist(poses.robots[other][:2], (x, y)))) for other in others]
        strong = [one for one in strong if one[1] >= LEAST_COUNTS]
        hidden = self._hidden(poses, robot, [other for other, _ in strong])
        for (other, strength), is_hidden in zip(strong, hidden, strict=True):
            if is_hidden:
                continue
            to_x, to_y, other_heading = poses.robots[other]
            towards = math.atan2(to_y - y, to_x - x)
            sent = beam(towards + math.pi - other_heading, self._emitter)
            scale = strength * self._per_emitter
            counts = tuple([scale * (sent[line] + sent[line + _LINES]) for line in range(_LINES)])
            found.append(Signal(other, counts, tuple(beam(towards - heading, self._receiver))))
        return found

    def _hidden(self, poses: Poses, robot: int, others: list[int]) -> list[bool]:
        """Whether a wall, an obstacle, an object or a third robot stands on the line to another robot's centre."""
        if not others:
            return []
        robot_count, object_count = poses.counts
        count = 3 * robot_count
        radii = np.array([bodies.ROBOT_RADIUS] * robot_count + self._objects[:object_count] + self._fixed_radii)
        robots = poses.values[:count].reshape(-1, 3)[:, :2]
        here = robots[robot]
        discs = np.concatenate((robots, poses.values[count:].reshape(-1, 2), self._fixed)) - here
        lines = robots[others] - here
        lengths2 = np.maximum((lines * lines).sum(axis=1), 1e-12)
        along = lines @ discs.T / lengths2[:, None]
        apart2 = (discs * discs).sum(axis=1) - along * along * lengths2[:, None]
        between = (along > 0) & (along < 1) & (apart2 < radii**2)
        between[:, robot] = False
        between[np.arange(len(others)), others] = False
        x, y = here.tolist()
        return [
            bool(covered) or any(geometry.meeting(x, y, dx, dy, side) < 1 for side in self._sides)
            for covered, (dx, dy) in zip(between.any(axis=1), lines.tolist(), strict=True)
        ]
