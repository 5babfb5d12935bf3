"""The world seen from above: walls, discs that rub on the floor, e-pucks with force-limited wheels (epuck.md §4).

Lengths cm, masses kg, time s. One `step` is one quantum, always of the same length; what acts on the bodies between two
steps is only the wheel speeds given to it. The same calls give the same numbers, to the bit.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import pymunk
import pymunk.batch
from numpy.typing import NDArray

from arena import bodies, geometry
from arena.placement import place_all
from arena.scene import Scene
from arena.scenery import ObjectKind

ITERATIONS: Final = 20
"""Of the constraint solver (epuck.md §4)."""
WALL_THICKNESS: Final = 20.0
"""Half thickness of the walls' segments in cm: nothing tunnels through."""
_FIELDS: Final = pymunk.batch.BodyFields.POSITION | pymunk.batch.BodyFields.ANGLE
_POSE, _PLACE = struct.Struct("3d"), struct.Struct("2d")
_set_velocity: Final[Any] = vars(pymunk.Body)["velocity"].fset
_set_turning: Final[Any] = vars(pymunk.Body)["angular_velocity"].fset
"""The setters behind the attributes, whose names are checked at a tenth of the cost of the physics."""
STREAM_WORLD, STREAM_WHEELS, STREAM_SENSORS, STREAM_START, STREAM_TRAITS, STREAM_EXPERIMENT = range(6)
"""Independent generators of a trial: `generator(seed, stream, robot)`."""


def generator(seed: int, stream: int, robot: int = 0) -> np.random.Generator:
    """The generator of one purpose and robot, independent of all others."""
    return np.random.default_rng([seed, stream, robot])


class Traits(NamedTuple):
    """How one robot differs from the others: its camera turned to the left and up, in rad and degrees; how much faster
    its wheels (left, right) are than commanded, as factors."""

    yaw: float = 0.0
    pitch_deg: float = 0.0
    bias: tuple[float, float] = (1.0, 1.0)


def traits_of(scene: Scene, seed: int, robot: int) -> Traits:
    """What is drawn once for a robot of a trial. Without spread nothing differs, to the bit."""
    spread = scene.robots
    yaw, pitch, left, right = generator(seed, STREAM_TRAITS, robot).normal(0.0, 1.0, 4).tolist()
    bias = (1.0 + spread.wheel_bias_sd * left, 1.0 + spread.wheel_bias_sd * right)
    return Traits(math.radians(spread.camera_yaw_sd_deg * yaw), spread.camera_pitch_sd_deg * pitch, bias)


class Poses:
    """Where everything is, never changed. Robots: x, y, heading; objects: x, y. cm and rad."""

    __slots__ = ("_objects", "robots", "table")

    def __init__(
        self,
        robots: list[tuple[float, float, float]],
        objects: list[tuple[float, float]] | None,
        table: Table | None = None,
    ) -> None:
        self.robots: Final = robots
        self._objects = objects
        self.table: Final = table
        """The same as bytes, if that is where they come from: the cheapest way to another process."""

    @classmethod
    def of(cls, table: Table) -> Poses:
        """Objects are read when first asked for: most quanta end before anybody looks."""
        return cls([_POSE.unpack_from(table.values, place) for place in table.robots], None, table)

    @property
    def objects(self) -> list[tuple[float, float]]:
        """Places of the objects."""
        if self._objects is None:
            assert self.table is not None
            values = self.table.values
            self._objects = [_PLACE.unpack_from(values, place) for place in self.table.objects]
        return self._objects


class Table(NamedTuple):
    """Doubles of any bodies as bytes: at which offsets those of robots (x, y, heading) and objects (x, y) are."""

    values: bytes
    robots: tuple[int, ...]
    objects: tuple[int, ...]


class World:
    """One arena with everything in it, placed by `seed`. Raises SceneError if there is no room."""

    def __init__(self, scene: Scene, seed: int) -> None:
        robots, objects = place_all(scene, generator(seed, STREAM_WORLD))
        self._build(scene, seed, robots, objects)

    @classmethod
    def of(
        cls,
        scene: Scene,
        seed: int,
        robots: Sequence[tuple[float, float, float]],
        objects: Sequence[tuple[float, float]],
    ) -> World:
        """A world with everything at given places (cm, rad): for calibrations and tests."""
        world = cls.__new__(cls)
        world._build(scene, seed, robots, objects)
        return world

    def _build(
        self,
        scene: Scene,
        seed: int,
        robots: Sequence[tuple[float, float, float]],
        objects: Sequence[tuple[float, float]],
    ) -> None:
        self.scene = scene
        self.dt = scene.clock.quantum_tcy / 14_745_600
        self.ticks = 0
        """Steps made so far."""
        self.space = pymunk.Space()
        self.space.iterations = ITERATIONS
        self.space.collision_slop = 0.01
        self._add_walls()
        self._add_obstacles()
        self._bias = [traits_of(scene, seed, robot).bias for robot in range(len(robots))]
        self.robots = [self._add_robot(*pose) for pose in robots]
        self._grips: list[tuple[pymunk.PivotJoint, pymunk.GearJoint] | None] = []
        self._drives = [self._add_drive(body) for body in self.robots]
        self._rests = [False] * len(robots)
        self.objects = [self._add_object(scene.kind_of(number), x, y) for number, (x, y) in enumerate(objects)]
        self._wheel_rng = [generator(seed, STREAM_WHEELS, robot) for robot in range(len(robots))]
        self._noise = [(1.0, 1.0)] * len(robots)
        self._noise_ticks = max(round(scene.robots.noise_period_s / self.dt), 1)
        self._buffer = pymunk.batch.Buffer()
        self._robot_places, self._object_places = self._find_places()
        self.poses = self._read()

    # -- building ----------------------------------------------------------------------------------------------------

    def _add_walls(self) -> None:
        width, height, half = self.scene.arena.width_cm, self.scene.arena.height_cm, WALL_THICKNESS
        corners = [(-half, -half), (width + half, -half), (width + half, height + half), (-half, height + half)]
        for one, other in zip(corners, corners[1:] + corners[:1], strict=True):
            wall = pymunk.Segment(self.space.static_body, one, other, half)
            wall.friction = bodies.CONTACT_FRICTION
            self.space.add(wall)

    def _add_obstacles(self) -> None:
        """The room's own shape and what stands fast in it: outlines as thin walls, and discs."""
        fixed, shapes = self.space.static_body, [self.scene.arena.polygon]
        shapes += [one.polygon for one in self.scene.obstacles]
        outlines = [side for shape in shapes if shape for side in geometry.sides(shape)]
        found: list[pymunk.Shape] = [pymunk.Segment(fixed, side[:2], side[2:], 0.0) for side in outlines]
        found += [pymunk.Circle(fixed, one.radius_cm, (one.x_cm, one.y_cm))
                  for one in self.scene.obstacles if one.radius_cm]  # fmt: skip
        for shape in found:
            shape.friction = bodies.CONTACT_FRICTION
            self.space.add(shape)

    def _disc(self, mass: float, radius: float, x: float, y: float) -> pymunk.Body:
        body = pymunk.Body(mass, bodies.disc_moment(mass, radius))
        body.position = x, y
        shape = pymunk.Circle(body, radius)
        shape.friction = math.sqrt(bodies.CONTACT_FRICTION)  # pymunk multiplies the two
        self.space.add(body, shape)
        return body

    def _add_robot(self, x: float, y: float, heading: float) -> pymunk.Body:
        body = self._disc(bodies.ROBOT_MASS, bodies.ROBOT_RADIUS, x, y)
        body.angle = heading
        return body

    def _add_drive(self, robot: pymunk.Body) -> pymunk.Body | None:
        """The wheels: a body that moves as commanded and pulls the robot along with at most the tyres' grip."""
        if math.isinf(self.scene.robots.thrust_n):
            self._grips.append(None)
            return None
        wheels = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        push = pymunk.PivotJoint(wheels, robot, (0, 0), (0, 0))
        turn = pymunk.GearJoint(wheels, robot, 0.0, 1.0)
        self._grips.append((push, turn))
        self._hold(len(self._grips) - 1, self.scene.robots.thrust_n)
        for joint in (push, turn):
            joint.max_bias = 0.0
            self.space.add(joint)
        self.space.add(wheels)
        return wheels

    def _hold(self, robot: int, force_n: float) -> None:
        """How hard the wheels of a robot pull or hold it."""
        joints = self._grips[robot]
        if joints is not None:
            push, turn = joints
            push.max_force = bodies.newton(force_n)
            turn.max_force = bodies.newton(force_n) * self.scene.robots.axle_cm / 2

    def _add_object(self, setting: ObjectKind, x: float, y: float) -> pymunk.Body:
        """Its friction on the floor is two joints of limited force that want it to stand still."""
        body = self._disc(setting.mass_kg, setting.radius_cm, x, y)
        grip = pymunk.PivotJoint(self.space.static_body, body, (0, 0), (0, 0))
        hold = pymunk.GearJoint(self.space.static_body, body, 0.0, 1.0)
        mu = setting.floor_friction
        grip.max_force = bodies.floor_force(setting.mass_kg, mu)
        hold.max_force = bodies.floor_torque(setting.mass_kg, setting.radius_cm, mu)
        for joint in (grip, hold):
            joint.max_bias = 0.0
            self.space.add(joint)
        return body

    # -- one quantum -------------------------------------------------------------------------------------------------

    def step(self, wheels: Sequence[tuple[float, float]]) -> None:
        """Act and physics: wheel speeds (left, right) in cm/s as commanded, for one quantum."""
        self._draw_noise()
        axle, dt = self.scene.robots.axle_cm, self.dt
        for index, (left, right) in enumerate(wheels):
            noise = self._noise[index]
            if (not left and not right) is not self._rests[index]:
                self._rests[index] = not self._rests[index]
                self._hold(index, self.scene.robots.brake_n if self._rests[index] else self.scene.robots.thrust_n)
            left, right = left * noise[0] * self._bias[index][0], right * noise[1] * self._bias[index][1]
            body, drive = self.robots[index], self._drives[index]
            turn = (right - left) / axle
            ahead = (left + right) / 2
            heading = self.poses.robots[index][2] + turn * dt / 2
            moved = drive if drive is not None else body
            _set_velocity(moved, (ahead * math.cos(heading), ahead * math.sin(heading)))
            _set_turning(moved, turn)
        self.space.step(dt)
        self.ticks += 1
        self.poses = self._read()

    def move(self, body: pymunk.Body, x: float, y: float, heading: float | None = None) -> None:
        """Put a robot or object somewhere else, at rest; cm, rad."""
        body.position, body.velocity, body.angular_velocity = (x, y), (0.0, 0.0), 0.0
        if heading is not None:
            body.angle = heading
        self.space.reindex_shapes_for_body(body)
        self.poses = self._read()

    def _draw_noise(self) -> None:
        share = self.scene.robots.wheel_noise
        if not share or self.ticks % self._noise_ticks:
            return
        for index, rng in enumerate(self._wheel_rng):
            left, right = rng.uniform(1 - share, 1 + share, 2).tolist()
            self._noise[index] = left, right

    def _find_places(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Where the poses of robots and objects are in the bytes of pymunk's list of all bodies, which stays as it is
        while none is removed."""
        self._buffer.clear()
        pymunk.batch.get_space_bodies(self.space, pymunk.batch.BodyFields.BODY_ID, self._buffer)
        found = np.frombuffer(self._buffer.int_buf(), dtype=np.int64).tolist()
        robots, objects = (
            tuple(_POSE.size * found.index(body.id) for body in some) for some in (self.robots, self.objects)
        )
        return robots, objects

    def _read(self) -> Poses:
        """All poses in one call: asking body by body costs more than the physics."""
        self._buffer.clear()
        pymunk.batch.get_space_bodies(self.space, _FIELDS, self._buffer)
        return Poses.of(Table(bytes(self._buffer.float_buf()), self._robot_places, self._object_places))

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return self.ticks * self.scene.clock.quantum_tcy / 14_745_600

    def object_places(self) -> NDArray[np.float64]:
        """Objects' centres, n x 2, cm."""
        return np.array(self.poses.objects, dtype=float).reshape(-1, 2)
