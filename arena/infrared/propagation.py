"""Propagation of infrared light between robots: strength by distance, angles of emitter and receiver, and occlusion.

The only published measurement between e-pucks is libIrcom's table of amplitudes by distance (swarmcom.md §3.1). The
shape of the beams is assumed (§7). Distances and angles are those of the line between the robots' centres, as in the
published calibration; this differs only for robots that touch. Nothing here depends on time: `channel.py` has the
states of the emitters, `ring.py` combines both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from ctypes import POINTER, Array, Structure, addressof, c_double, c_int64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from arena.scene import dimensions, geometry
from arena.scene.loader import Scene
from arena.scene.robot_kind import EPUCK
from arena.world.poses import Poses
from emu.boards.epuck.analog import PULSE_PINS, RESPONSE, SENSORS, SLOPES
from emu.native_library import ADDRESS, INT, address_of, functions

PUBLISHED: Final = (
    (7.5, 3534.0), (8.0, 2104.0), (8.5, 1135.0), (9.0, 702.0), (9.5, 509.0), (10.0, 376.0), (10.5, 305.0),
    (11.0, 264.0), (11.5, 207.0), (12.0, 167.0), (12.5, 137.0), (13.0, 113.0), (13.5, 91.6), (14.0, 79.2),
    (14.5, 69.4), (15.0, 66.1), (15.5, 51.4), (16.0, 44.0), (16.5, 38.5), (17.0, 35.0), (17.5, 31.7), (18.0, 28.0),
    (18.5, 25.9), (19.0, 23.4), (19.5, 22.0), (20.0, 20.0), (20.5, 18.3), (21.0, 17.1), (21.5, 16.1), (22.0, 14.6),
)  # fmt: skip
"""libIrcom's table: distance of the centres in cm, and counts between dark and lit (swarmcom.md §3.1). That distances
are between centres is UNVERIFIED: it is inferred from the first entry, robots that touch."""
LAW_COUNTS, LAW_FROM_CM, LAW_POWER = 10_269.0, 6.0, -2.354
"""Counts A at d cm, fitted to that table: A(d) = 10269 (d - 6)^-2.354, error 6.3 % (swarmcom.md §3.1). UNVERIFIED
beyond 22 cm."""
MAX_COUNTS: Final = 3500.0
"""Greatest amplitude of one robot, at which the table saturates (swarmcom.md §3.1)."""
MIN_COUNTS: Final = 0.1
"""Least amplitude of a sender, reached at 140 cm. Weaker senders are omitted: a swarm of them is below one count."""
_LINES: Final = len(PULSE_PINS)
_BEARINGS: Final = tuple(math.radians(bearing) for bearing in dimensions.IR_BEARINGS_DEG)


class Surface(NamedTuple):
    """The surface that a sensor faces.

    `millimetres` is the distance from the robot's edge, inf beyond `dimensions.IR_RANGE`; of several rays
    (`infrared.side_rays`) the least one. `share` is the reflection as a share of a white perpendicular surface's; at an
    angle it falls with the cosine (Lambert, UNVERIFIED).
    """

    millimetres: float
    share: float


class Signal(NamedTuple):
    """Light of `robot` at another one: counts of each pulse line on a sensor that faces it, and each sensor's share."""

    robot: int
    counts: tuple[float, ...]
    shares: tuple[float, ...]


def amplitude(distance_cm: float) -> float:
    """Return the counts by which a robot with all emitters lit differs from a dark one, at a robot that faces it."""
    beyond = distance_cm - LAW_FROM_CM
    return min(LAW_COUNTS * float(beyond**LAW_POWER), MAX_COUNTS) if beyond > 0 else MAX_COUNTS


def is_in_reach(height_cm: float) -> bool:
    """Whether a body blocks and reflects infrared light: light passes over bodies lower than the ring."""
    return height_cm >= dimensions.IR_HEIGHT


def distance_of(counts: float) -> float:
    """Return the distance in cm at which the amplitude is `counts`: the inverse of `amplitude`."""
    return LAW_FROM_CM + float((counts / LAW_COUNTS) ** (1 / LAW_POWER))


def beam(towards: float, power: float) -> list[float]:
    """Return the shares of the eight emitters or receivers for a direction, rad counter-clockwise from the front."""
    return [max(math.cos(towards + bearing), 0.0) ** power for bearing in _BEARINGS]


@cache
def brightest(power: float) -> float:
    """Return the sum of all emitters in their strongest direction, to which the amplitude of the law refers."""
    return max(sum(beam(math.radians(degrees / 4), power)) for degrees in range(4 * 360))


class _Disc(Structure):
    """`struct disc` of propagation.c."""

    _fields_ = [(name, c_double) for name in ("x", "y", "radius", "share")]


class _Side(Structure):
    """`struct side` of propagation.c."""

    _fields_ = [(name, c_double) for name in ("ax", "ay", "bx", "by", "share")]


class _Polygon(Structure):
    """`struct polygon` of propagation.c."""

    _fields_ = [("corners", c_void_p), ("count", c_int64), ("object", c_int64), ("share", c_double)]


class _Optics(Structure):
    """`struct optics` of propagation.c."""

    _fields_ = [
        *((name, c_double) for name in ("law_counts", "law_from", "law_power", "max_counts", "min_counts", "gain",
                                        "per_emitter", "emitter_power", "receiver_power", "width", "height",
                                        "wall_share", "range")),
        ("bearings", c_double * SENSORS), ("robots", POINTER(_Disc)), ("objects", POINTER(_Disc)),
        ("fixed", POINTER(_Disc)), ("fixed_count", c_int64), ("sides", POINTER(_Side)), ("side_count", c_int64),
        ("polygons", POINTER(_Polygon)), ("polygon_count", c_int64), ("side_rays", c_int64), ("half_beam", c_double),
        *((name, c_double * len(RESPONSE)) for name in ("near", "counts", "slope")),
    ]  # fmt: skip


class _Poses(Structure):
    """`struct poses` of propagation.c."""

    _fields_ = [("values", c_void_p), ("robots", c_int64), ("objects", c_int64)]


@cache
def _code() -> dict[str, Callable[..., Any]]:
    """Return the functions of propagation.c."""
    return functions(Path(__file__).with_name("propagation.c"), {
        "signal": (INT, (ADDRESS, ADDRESS, INT, INT, ADDRESS)),
        "surfaces": (None, (ADDRESS, ADDRESS, INT, ADDRESS)),
    })  # fmt: skip


class Optics:
    """Propagation of infrared light in a scene, computed by native code (propagation.c)."""

    def __init__(self, scene: Scene) -> None:
        code, setting = _code(), scene.infrared
        self._signal, self._surfaces = code["signal"], code["surfaces"]
        self._scene = scene
        self._robots = self._robot_discs(scene.robots.count)
        kinds = list(map(scene.kind_of, range(scene.objects.count)))
        self._objects = (_Disc * scene.objects.count)(*(
            _Disc(0, 0, kind.radius_cm if is_in_reach(kind.height_cm) and not kind.polygon else 0, kind.share)
            for kind in kinds
        ))  # fmt: skip
        shaped = [(number, kind) for number, kind in enumerate(kinds) if kind.polygon]
        self._corners = [np.array(geometry.centred(kind.polygon) if is_in_reach(kind.height_cm) else (), dtype=float)
                         for _, kind in shaped]  # fmt: skip
        self._polygons = (_Polygon * len(shaped))(*(
            _Polygon(corners.ctypes.data, len(corners), number, kind.share)
            for (number, kind), corners in zip(shaped, self._corners, strict=True)
        ))  # fmt: skip
        obstacles = [one for one in scene.obstacles if is_in_reach(one.height_cm)]
        fixed = [_Disc(one.x_cm, one.y_cm, one.radius_cm, one.share) for one in obstacles if one.radius_cm]
        self._fixed = (_Disc * len(fixed))(*fixed)
        shapes = [(scene.arena.polygon, setting.wall_share), *((one.polygon, one.share) for one in obstacles)]
        sides = [_Side(*side, share) for shape, share in shapes if shape for side in geometry.sides(shape)]
        self._sides = (_Side * len(sides))(*sides)
        self._optics = _Optics(
            LAW_COUNTS, LAW_FROM_CM, LAW_POWER, MAX_COUNTS, MIN_COUNTS,
            setting.signal_gain, 1 / brightest(setting.emitter_power), setting.emitter_power, setting.receiver_power,
            *scene.arena.extent, setting.wall_share, dimensions.IR_RANGE,
            (c_double * SENSORS)(*_BEARINGS), self._robots, self._objects,
            self._fixed, len(fixed), self._sides, len(sides), self._polygons, len(shaped),
            setting.side_rays, math.radians(dimensions.IR_HALF_BEAM_DEG), *zip(*RESPONSE, strict=True), SLOPES,
        )  # fmt: skip
        self._at = addressof(self._optics)
        self._poses = _Poses()
        self._poses_at = addressof(self._poses)
        self._found = (c_double * (2 * SENSORS))()
        self._found_at = addressof(self._found)

    def _robot_discs(self, count: int) -> Array[_Disc]:
        """Return the discs of `count` robots, radius 0 without reflection. Robots beyond the scene's are e-pucks."""
        of_scene = min(count, self._scene.robots.count)
        kinds = [*map(self._scene.robot_kind, range(of_scene)), *[EPUCK] * (count - of_scene)]
        return (_Disc * count)(*(
            _Disc(0, 0, kind.radius_cm if is_in_reach(kind.height_cm) else 0, self._scene.infrared.robot_share)
            for kind in kinds
        ))  # fmt: skip

    def native_handle(self) -> tuple[int, int, int, int]:
        """Return the host addresses of `signal`, `surfaces`, and their first two arguments (propagation.c).

        `set_poses` fills the second one.
        """
        return address_of(self._signal), address_of(self._surfaces), self._at, self._poses_at

    def set_poses(self, poses: Poses) -> None:
        """Pass the poses to native code. Raises ValueError if their objects are not the first ones of the scene."""
        robots, objects, polygons = poses.counts
        if robots > len(self._robots):
            self._robots = self._robot_discs(robots)
            self._optics.robots = self._robots
        if objects > len(self._objects):
            raise ValueError(f"{objects} objects are more than the scene has")
        if polygons != sum(one.object < objects for one in self._polygons):
            raise ValueError(f"{polygons} polygons are not those of the scene's first {objects} objects")
        self._poses.values, self._poses.robots, self._poses.objects = poses.address, robots, objects

    def signals(self, poses: Poses, robot: int, others: Iterable[int]) -> list[Signal]:
        """Return the light of `others` at a robot; senders of which it receives nothing are omitted."""
        self.set_poses(poses)
        found: list[Signal] = []
        for other in others:
            if self._signal(self._at, self._poses_at, robot, other, self._found_at):
                values = tuple(self._found)
                found.append(Signal(other, values[:_LINES], values[_LINES : _LINES + SENSORS]))
        return found

    def surfaces(self, poses: Poses, robot: int) -> list[Surface]:
        """Return the surface that each sensor faces: wall, obstacle, object or robot."""
        self.set_poses(poses)
        self._surfaces(self._at, self._poses_at, robot, self._found_at)
        found = iter(self._found)
        return [Surface(10 * centimetres, share) for centimetres, share in zip(found, found, strict=True)]
