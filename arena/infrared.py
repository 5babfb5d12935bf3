"""The infrared ring in the world: own reflections, room light, a lamp, and the emitters of other robots (epuck.md §5).

Nothing is computed before the firmware converts one of the eight channels, and then once per quantum. Light of other
robots arrives one quantum late, so that no robot depends on which of them has lived first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

from arena import bodies, geometry
from arena.ether import Ether
from arena.optics import Optics, Signal
from arena.scene import FCY, Scene
from arena.world import STREAM_INFRARED, Poses, generator
from emu.boards.epuck.analog import PULSE_PINS, SENSORS, reflection_at
from emu.boards.epuck.board import Epuck
from emu.boards.noise import gaussian

LAMP_CM: Final = 100.0
"""Distance at which `light.lamp_counts` holds."""
_RIPPLE: Final = math.tau * 100 / FCY
"""Of lamps on the mains, rad per Tcy."""


class Surface(NamedTuple):
    """What a sensor's axis meets: mm from the sensor, and reflection as a share of a white perpendicular surface's."""

    millimetres: float
    share: float


class Ring:
    """The eight sensors of one robot, put between its board and the world. Cycles of the board are `on_at` behind."""

    def __init__(self, scene: Scene, seed: int, board: Epuck, ether: Ether, robot: int, on_at: int) -> None:
        self._scene = scene
        self._board = board
        self._ether = ether
        self._robot = robot
        self._on_at = on_at
        self._poses = Poses([], [])
        self._is_stale = True
        self._unfelt = 0
        """Bit n: nobody has asked for sensor n since the poses changed."""
        self.is_read = False
        """Whether the firmware has ever converted one of the sensors."""
        self.look: Callable[[], Poses] | None = None
        """Where poses come from before that; later `move` tells them."""
        self._optics: Optics | None = None
        self._heard: list[Signal] = []
        rng = generator(seed, STREAM_INFRARED, robot)
        self._seed = int(rng.integers(1 << 62))
        self._offsets = rng.normal(0.0, scene.light.ambient_sd_counts, SENSORS).tolist()
        board.ir.tau_seconds = scene.infrared.tau_us * 1e-6
        board.ir.shine(self._light)
        for line, pin in enumerate(PULSE_PINS):
            board.chip.pins.watch(pin, partial(self._switched, line))

    def move(self, poses: Poses) -> None:
        """A quantum begins. What was sampled before it is made final first."""
        if self.is_read:
            self._board.chip.adc.catch_up(self._board.chip.adc.now)
        self._poses = poses
        self._is_stale = True

    @property
    def readings(self) -> list[int] | None:
        """Counts by which the own emitters lower the sensors when lit; None if none was ever converted."""
        if not self.is_read:
            return None
        for sensor in range(SENSORS):
            self._feel(sensor)
        return list(self._board.ir.reflection)

    def _switched(self, line: int, cycle: int, changed: int, levels: int) -> None:
        if not self._board.ir.events.quiet:  # others have seen what is run again
            self._ether.switch(self._robot, self._on_at + cycle, line, bool(levels & changed))

    def _light(self, sensor: int, cycle: int) -> float:
        """Counts taken off by other robots' light, noise and lamps on the mains; the rest is brought up to date."""
        if self._is_stale:
            self._sense(cycle)
        if self._unfelt >> sensor & 1:
            self._feel(sensor)
        setting, now, light = self._scene.infrared, self._on_at + cycle, 0.0
        for other, counts, shares in self._heard:
            if shares[sensor]:
                lit = self._ether.shares(other, now)
                light += shares[sensor] * sum([one * share for one, share in zip(counts, lit, strict=True)])
        if setting.ripple_counts:
            light += setting.ripple_counts * math.sin(_RIPPLE * now)
        if setting.noise_counts:
            light += setting.noise_counts * gaussian(self._seed, sensor, now)
        return light

    def _sense(self, cycle: int) -> None:
        if self.look is not None and not self.is_read:
            self._poses = self.look()
        self._is_stale, self.is_read, self._unfelt = False, True, (1 << SENSORS) - 1
        if self._optics is None:
            self._optics = Optics(self._scene)
        ir = self._board.ir
        counts = ambient(self._scene, self._poses.robots[self._robot])
        for sensor, (one, offset) in enumerate(zip(counts, self._offsets, strict=True)):
            ir.ambient[sensor] = min(max(round(one + offset), 0), 4095)
        now, others = self._on_at + cycle, range(len(self._poses.robots))
        lit = [other for other in others if other != self._robot
               and not self._ether.is_dark(other, now, now + self._ether.quantum)]  # fmt: skip
        self._heard = self._optics.signals(self._poses, self._robot, lit) if lit else []

    def _feel(self, sensor: int) -> None:
        """What a sensor sees of its own light, when it is first asked for."""
        if self._optics is not None and self._unfelt >> sensor & 1:
            self._unfelt &= ~(1 << sensor)
            distance, share = self._optics.surface(self._poses, self._robot, sensor)
            self._board.ir.reflection[sensor] = round(reflection_at(distance) * share)


_BEARINGS: Final = tuple(math.radians(bearing) for bearing in bodies.IR_BEARINGS_DEG)


def _axis(pose: tuple[float, float, float], sensor: int) -> tuple[float, float]:
    """Unit vector of a sensor of a robot, which is also its emitter's."""
    angle = pose[2] - _BEARINGS[sensor]
    return math.cos(angle), math.sin(angle)


def _axes(pose: tuple[float, float, float]) -> list[tuple[float, float]]:
    """Of all of them."""
    return [_axis(pose, sensor) for sensor in range(SENSORS)]


def surfaces(scene: Scene, poses: Poses, robot: int) -> list[Surface]:
    """What each sensor's axis meets from the body's edge: wall, object or robot, beyond IR_RANGE nothing (inf mm)."""
    near = nearby(scene, poses, robot)
    return [surface(scene, near, sensor) for sensor in range(SENSORS)]


class Nearby(NamedTuple):
    """What sensors of a robot can reach: discs as (x, y, radius, share) from its middle, sides with their shares."""

    pose: tuple[float, float, float]
    discs: list[tuple[float, float, float, float]]
    outlines: list[tuple[geometry.Side, float]]


def nearby(scene: Scene, poses: Poses, robot: int) -> Nearby:
    """What is near a robot."""
    x, y, _ = pose = poses.robots[robot]
    ring = scene.infrared
    discs = [(ox - x, oy - y, radius, share) for ox, oy, radius, share in _objects(scene, poses)]
    discs += [(one.x_cm - x, one.y_cm - y, one.radius_cm, one.share) for one in scene.obstacles if one.radius_cm]
    discs += [(one[0] - x, one[1] - y, bodies.ROBOT_RADIUS, ring.robot_share)
              for i, one in enumerate(poses.robots) if i != robot]  # fmt: skip
    reach = bodies.ROBOT_RADIUS + bodies.IR_RANGE
    near = [disc for disc in discs if disc[0] * disc[0] + disc[1] * disc[1] < (reach + disc[2]) ** 2]
    return Nearby(pose, near, [one for one in _outlines(scene) if geometry.distance_to(x, y, one[0]) < reach])


def surface(scene: Scene, near: Nearby, sensor: int) -> Surface:
    """What one sensor's axis meets. A surface that stands askew reflects by the cosine (Lambert, UNVERIFIED)."""
    x, y, _ = near.pose
    east, north = _axis(near.pose, sensor)
    to_x, to_y = _to_wall(x, east, scene.arena.width_cm), _to_wall(y, north, scene.arena.height_cm)
    distance, share = (to_x, abs(east)) if to_x < to_y else (to_y, abs(north))
    share *= scene.infrared.wall_share
    for side, white in near.outlines:
        along = geometry.meeting(x, y, east, north, side)
        if along < distance:
            distance, share = along, white * abs(_facing(side, east, north))
    for dx, dy, r, white in near.discs:
        along = dx * east + dy * north
        root = r * r - (dx * dx + dy * dy - along * along)
        if root > 0 and along > 0 and along - math.sqrt(root) < distance:
            distance, share = along - math.sqrt(root), white * math.sqrt(root) / r
    gap = max(distance - bodies.ROBOT_RADIUS, 0.0)
    return Surface(10 * gap, share) if gap <= bodies.IR_RANGE else Surface(math.inf, 0.0)


def _outlines(scene: Scene) -> list[tuple[geometry.Side, float]]:
    """Sides of the room and of obstacles with their shares, made once for a scene."""
    kept = _kept.get(id(scene))
    if kept is None or kept[0] is not scene:
        room = geometry.sides(scene.arena.polygon) if scene.arena.polygon else []
        found = [(side, scene.infrared.wall_share) for side in room]
        found += [(side, one.share) for one in scene.obstacles if one.polygon for side in geometry.sides(one.polygon)]
        if len(_kept) > 16:
            _kept.clear()
        kept = _kept[id(scene)] = scene, found
    return kept[1]


_kept: dict[int, tuple[Scene, list[tuple[geometry.Side, float]]]] = {}


def _objects(scene: Scene, poses: Poses) -> list[tuple[float, float, float, float]]:
    """Place, radius and share of every object."""
    if not scene.kinds:
        return [(x, y, scene.objects.radius_cm, scene.infrared.object_share) for x, y in poses.objects]
    kinds = map(scene.kind_of, range(len(poses.objects)))
    return [(x, y, one.radius_cm, one.share) for (x, y), one in zip(poses.objects, kinds, strict=True)]


def _facing(side: geometry.Side, east: float, north: float) -> float:
    """Cosine between a ray and what stands upright on a side."""
    dx, dy = side[2] - side[0], side[3] - side[1]
    return (east * dy - north * dx) / math.hypot(dx, dy)


def _to_wall(at: float, direction: float, size: float) -> float:
    """Along a ray to the walls at 0 and `size` of one axis."""
    if direction == 0:
        return math.inf
    return ((size if direction > 0 else 0.0) - at) / direction


def ambient(scene: Scene, pose: tuple[float, float, float]) -> list[int]:
    """Raw counts of the sensors with all emitters off: the room's, lowered by the lamp (high above the arena, without
    shadows) as 1 / d^2 and by the cosine of the angle to it."""
    light = scene.light
    lamps = [(one.x_cm, one.y_cm, one.counts) for one in scene.lamps]
    if light.lamp_counts:
        lamps.append((light.lamp_x_cm, light.lamp_y_cm, light.lamp_counts))
    if not lamps:
        return [light.ambient_counts] * SENSORS
    taken = [0.0] * SENSORS
    for x, y, counts in lamps:
        dx, dy = x - pose[0], y - pose[1]
        distance = max(math.hypot(dx, dy), bodies.ROBOT_RADIUS)
        full = counts * (LAMP_CM / distance) ** 2
        for sensor, (east, north) in enumerate(_axes(pose)):
            taken[sensor] += full * max((dx * east + dy * north) / distance, 0.0)
    return [round(max(light.ambient_counts - one, 0.0)) for one in taken]
