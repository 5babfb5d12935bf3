"""The world in two dimensions: walls, objects with floor friction, robots with force-limited drives (epuck.md §4).

Lengths cm, masses kg, time s. One `step` is one quantum, always of the same length. Only the wheel speeds act on the
bodies between two steps. The same calls give the same numbers, to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from ctypes import POINTER, Structure, addressof, c_double, c_int64, c_void_p, pointer
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pymunk
from numpy.typing import NDArray
from pymunk._chipmunk_cffi import ffi, lib

from arena.scene import dimensions, geometry
from arena.scene.loader import Scene
from arena.scene.placement import Place, place_all
from arena.scene.robot_kind import Drive, RobotKind, Traits
from arena.scene.schema import ObjectKind
from arena.world import solver
from arena.world.poses import PoseBlock, Poses
from emu.native_library import ADDRESS, INT, address_of, functions

ITERATIONS: Final = 20
"""Iterations of the constraint solver (epuck.md §4)."""
ROWS: Final = 256
"""Rows of the pose buffer (`sheet`): each row holds the poses at the end of one quantum."""
COLLISION_SLOP: Final = 0.01
"""Overlap in cm that the solver leaves between bodies in contact."""
SHAPE_FRICTION: Final = math.sqrt(dimensions.CONTACT_FRICTION)
"""Friction of every shape: pymunk multiplies the values of two shapes in contact."""
WALL_THICKNESS: Final = 20.0
"""Half thickness of the wall segments in cm: too thick for any body to tunnel through."""
(STREAM_WORLD, STREAM_WHEELS, STREAM_SENSORS, STREAM_START, STREAM_TRAITS, STREAM_EXPERIMENT, STREAM_INFRARED,
 STREAM_CONTROLLERS) = range(8)  # fmt: skip
"""Streams of independent random numbers in a trial: `generator(seed, stream, robot)`."""


def generator(seed: int, stream: int, robot: int = 0) -> np.random.Generator:
    """Return the random generator of one stream and robot, independent of all others."""
    return np.random.default_rng([seed, stream, robot])


def traits_of(scene: Scene, seed: int, robot: int) -> Traits:
    """Draw the deviations of a robot in a trial. With zero spread they are exactly those of the nominal robot."""
    kind = scene.robot_kind(robot)
    return kind.traits(getattr(scene, kind.table), generator(seed, STREAM_TRAITS, robot).normal(0.0, 1.0, 4).tolist())


class _Chipmunk(Structure):
    """`struct chipmunk` of physics.c: functions of the physics library, by their names there."""

    NAMES: Final = ("cpSpaceStep", "cpBodySetVelocity", "cpBodySetAngularVelocity", "cpBodyGetPosition",
                    "cpBodyGetAngle", "cpConstraintSetMaxForce", "cpBodyGetVelocity", "cpBodyGetAngularVelocity",
                    "cpConstraintGetImpulse", "cpSpaceAddConstraint", "cpSpaceRemoveConstraint", "cpBodyEachArbiter",
                    "cpArbiterTotalImpulse")  # fmt: skip
    _fields_ = [(name, c_void_p) for name in NAMES]


class _Drive(Structure):
    """`struct drive` of physics.c."""

    _fields_ = [(name, c_double) for name in ("axle", "ahead", "turn", "leg_back", "leg_aside", "thrust",
                                              "thrust_torque", "brake", "brake_torque")]  # fmt: skip

    @classmethod
    def of(cls, drive: Drive) -> _Drive:
        """Return the struct of a drive."""
        forces = [force for newtons in (drive.thrust_n, drive.brake_n) for force in _grip(drive, newtons)]
        return cls(drive.axle_cm, drive.ahead, drive.turn, drive.leg_back_cm, drive.leg_aside_cm, *forces)


def _grip(drive: Drive, force_n: float) -> tuple[float, float]:
    """Return the greatest force and torque with which a drive pulls or holds a robot."""
    return dimensions.newton(force_n), dimensions.newton(force_n) * drive.lever_cm


class _Robot(Structure):
    """`struct robot` of physics.c."""

    _fields_ = [
        *((name, c_void_p) for name in ("body", "driven_body", "push_joint", "turn_joint")), ("drive", POINTER(_Drive)),
        ("bias", c_double * 2), ("noise", c_double * 2), ("is_braked", c_int64),
    ]  # fmt: skip


class _Disc(Structure):
    """`struct disc` of physics.c."""

    _fields_ = [
        *((name, c_void_p) for name in ("body", "slide_joint", "spin_joint")), ("radius", c_double),
        ("checked_at", c_double * 2), *((name, c_int64) for name in ("is_checked", "is_resting", "can_rest")),
    ]  # fmt: skip


class _World(Structure):
    """`struct world` of physics.c."""

    _fields_ = [
        ("chipmunk", _Chipmunk), ("space", c_void_p),
        ("dt", c_double), ("robot_count", c_int64), ("object_count", c_int64),
        ("robots", POINTER(_Robot)), ("discs", POINTER(_Disc)), ("steps", c_int64),
        ("polygons", POINTER(c_void_p)), ("polygon_count", c_int64),
        ("solve", c_void_p), ("solver", c_void_p),  # null: the library solves
    ]  # fmt: skip


class NativeWorld(Structure):
    """`struct native_world` of lockstep.c: the world as native code runs it."""

    _fields_ = [
        *((name, c_void_p) for name in ("quanta", "world", "wheels")), ("width", c_int64),
        ("ticks", c_int64),  # finished quanta
        ("limit", c_int64),  # tick up to which native code can run
        *((name, c_void_p) for name in ("row", "now", "before")),  # addresses: free row, current, previous poses
    ]  # fmt: skip


@cache
def _code() -> dict[str, Callable[..., Any]]:
    """Return the functions of physics.c."""
    return functions(Path(__file__).with_name("physics.c"), {
        "run_quantum": (None, (ADDRESS, ADDRESS)), "read_poses": (None, (ADDRESS, ADDRESS)),
        "run_quanta": (None, (ADDRESS, ADDRESS, INT, INT, INT, ADDRESS, ADDRESS, INT)),
    })  # fmt: skip


def _address(thing: Any) -> int:
    """Return the address of an object or function of the physics library."""
    return int(ffi.cast("intptr_t", thing))


class World:
    """One arena with all its bodies, placed by `seed`. Raises SceneError if it has no room for them."""

    def __init__(self, scene: Scene, seed: int) -> None:
        robots, objects = place_all(scene, generator(seed, STREAM_WORLD))
        self._build(scene, seed, robots, objects)

    @classmethod
    def of(
        cls,
        scene: Scene,
        seed: int,
        robots: Sequence[tuple[float, float, float]],
        objects: Sequence[Place],
    ) -> World:
        """Return a world with the bodies at given poses (cm, rad), for calibrations and tests."""
        world = cls.__new__(cls)
        world._build(scene, seed, robots, objects)
        return world

    def _build(
        self,
        scene: Scene,
        seed: int,
        robots: Sequence[tuple[float, float, float]],
        objects: Sequence[Place],
    ) -> None:
        self.scene = scene
        self.dt = scene.clock.quantum_tcy / 14_745_600
        self.ticks = 0
        """Finished quanta."""
        self.space = pymunk.Space()
        self.space.iterations = ITERATIONS
        self.space.collision_slop = COLLISION_SLOP
        if scene.arena.walls:
            self._add_walls()
        self._add_obstacles()
        self._kinds: list[RobotKind] = [scene.robot_kind(robot) for robot in range(len(robots))]
        self._drives: dict[str, Drive] = {kind.name: kind.drive(getattr(scene, kind.table)) for kind in self._kinds}
        self.robots = [self._add_robot(kind, *pose) for kind, pose in zip(self._kinds, robots, strict=True)]
        self._joints: list[tuple[pymunk.PivotJoint, pymunk.GearJoint] | None] = []
        drives = [self._add_drive(kind, body) for kind, body in zip(self._kinds, self.robots, strict=True)]
        self._floor: list[tuple[pymunk.PivotJoint, pymunk.GearJoint]] = []
        kinds = list(map(scene.kind_of, range(len(objects))))
        self.objects = [self._add_object(kind, *place) for kind, place in zip(kinds, objects, strict=True)]
        self._polygons = [body for kind, body in zip(kinds, self.objects, strict=True) if kind.polygon]
        self._wheel_rng = [generator(seed, STREAM_WHEELS, robot) for robot in range(len(robots))]
        self._noises = [self._drives[kind.name].noise for kind in self._kinds]
        """Noise of each robot's drive."""
        self._noise_ticks = max(round(scene.robots.noise_period_s / self.dt), 1)
        self._fill_structs(seed, drives)
        self.poses = self._read()

    def _fill_structs(self, seed: int, drives: Sequence[pymunk.Body | None]) -> None:
        """Fill the structs of physics.c. The bodies exist as long as the world."""
        code = _code()
        self._run_quantum, self._run_quanta, self._read_poses = (
            code[name] for name in ("run_quantum", "run_quanta", "read_poses")
        )
        self._robots = (_Robot * len(self.robots))()
        self._drive_structs = {name: _Drive.of(drive) for name, drive in self._drives.items()}
        parts = zip(self._robots, self.robots, drives, self._joints, self._kinds, strict=True)
        for number, (robot, body, drive, joints, kind) in enumerate(parts):
            robot.drive = pointer(self._drive_structs[kind.name])
            robot.body, robot.driven_body = _address(body._body), _address((drive or body)._body)
            if joints is not None:
                robot.push_joint, robot.turn_joint = (_address(joint._constraint) for joint in joints)
            robot.bias[:] = traits_of(self.scene, seed, number).bias
            robot.noise[:] = 1.0, 1.0
        discs = [_Disc(robot.body, None, None, kind.radius_cm)
                 for robot, kind in zip(self._robots, self._kinds, strict=True)]  # fmt: skip
        for number, (body, joints) in enumerate(zip(self.objects, self._floor, strict=True)):
            addresses = (_address(joint._constraint) for joint in joints)
            discs.append(_Disc(_address(body._body), *addresses, self.scene.kind_of(number).radius_cm))
        self._discs = (_Disc * len(discs))(*discs)
        polygons = (c_void_p * len(self._polygons))(*(_address(body._body) for body in self._polygons))
        self._world = _World(
            _Chipmunk(*(_address(ffi.addressof(lib, name)) for name in _Chipmunk.NAMES)), _address(self.space._space),
            self.dt, len(self._robots), len(self.objects), self._robots, self._discs, 0, polygons, len(polygons),
        )  # fmt: skip
        pivots = [_address(pivot._constraint) for pivot, _ in (*filter(None, self._joints), *self._floor)]
        self._solver = solver.replace_own(_address(self.space._space), pivots, len(discs), ITERATIONS)
        if self._solver:
            self._world.solve, self._world.solver = self._solver.function, self._solver.address
        self._at = addressof(self._world)
        self._wheels = np.zeros((len(self.robots), 2))
        self._wheels_at = self._wheels.ctypes.data
        self._width = 3 * len(self.robots) + 2 * len(self.objects) + len(self._polygons)
        self._sheet, self._sheet_at, self._row = np.empty((0, self._width)), 0, 0
        self._row_bytes = self._sheet.itemsize * self._width
        self.native = NativeWorld(address_of(self._run_quanta), self._at, self._wheels_at, self._width)
        """The world as native code runs it, after `prepare_native`."""

    # -- building ----------------------------------------------------------------------------------------------------

    def _add_walls(self) -> None:
        """Add the four walls of the arena."""
        width, height, half = self.scene.arena.width_cm, self.scene.arena.height_cm, WALL_THICKNESS
        corners = [(-half, -half), (width + half, -half), (width + half, height + half), (-half, height + half)]
        for one, other in zip(corners, corners[1:] + corners[:1], strict=True):
            wall = pymunk.Segment(self.space.static_body, one, other, half)
            wall.friction = SHAPE_FRICTION
            self.space.add(wall)

    def _add_obstacles(self) -> None:
        """Add the outline of the room and its obstacles: polygons as thin walls, and discs."""
        fixed, shapes = self.space.static_body, [self.scene.arena.polygon]
        shapes += [one.polygon for one in self.scene.obstacles]
        outlines = [side for shape in shapes if shape for side in geometry.sides(shape)]
        found: list[pymunk.Shape] = [pymunk.Segment(fixed, side[:2], side[2:], 0.0) for side in outlines]
        found += [pymunk.Circle(fixed, one.radius_cm, (one.x_cm, one.y_cm))
                  for one in self.scene.obstacles if one.radius_cm]  # fmt: skip
        for shape in found:
            shape.friction = SHAPE_FRICTION
            self.space.add(shape)

    def _body(self, mass: float, radius: float, x: float, y: float, corners: geometry.Corners = ()) -> pymunk.Body:
        """Add a disc or, with `corners`, a polygon that can be pushed."""
        moment = pymunk.moment_for_poly(mass, corners) if corners else dimensions.disc_moment(mass, radius)
        body = pymunk.Body(mass, moment)
        body.position = x, y
        shape = pymunk.Poly(body, corners) if corners else pymunk.Circle(body, radius)
        shape.friction = SHAPE_FRICTION
        self.space.add(body, shape)
        return body

    def _add_robot(self, kind: RobotKind, x: float, y: float, heading: float) -> pymunk.Body:
        """Add the body of a robot."""
        body = self._body(kind.mass_kg, kind.radius_cm, x, y)
        body.angle = heading
        return body

    def _add_drive(self, kind: RobotKind, robot: pymunk.Body) -> pymunk.Body | None:
        """Add the wheels or legs: a body that moves as commanded and pulls the robot with at most their grip."""
        drive = self._drives[kind.name]
        if math.isinf(drive.thrust_n):
            self._joints.append(None)
            return None
        wheels = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        push = pymunk.PivotJoint(wheels, robot, (0, 0), (0, 0))
        turn = pymunk.GearJoint(wheels, robot, 0.0, 1.0)
        self._joints.append((push, turn))
        push.max_force, turn.max_force = _grip(drive, drive.thrust_n)
        for joint in (push, turn):
            joint.max_bias = 0.0
            self.space.add(joint)
        self.space.add(wheels)
        return wheels

    def _add_object(self, setting: ObjectKind, x: float, y: float, heading: float = 0.0) -> pymunk.Body:
        """Add an object. Its floor friction is two joints of limited force that hold it at rest."""
        corners = geometry.centred(setting.polygon) if setting.polygon else ()
        body = self._body(setting.mass_kg, setting.radius_cm, x, y, corners)
        body.angle = heading
        slide = pymunk.PivotJoint(self.space.static_body, body, (0, 0), (0, 0))
        spin = pymunk.GearJoint(self.space.static_body, body, 0.0, 1.0)
        mu = setting.floor_friction
        slide.max_force = dimensions.floor_force(setting.mass_kg, mu)
        spin.max_force = (slide.max_force * geometry.mean_distance(corners) if corners else
                          dimensions.floor_torque(setting.mass_kg, setting.radius_cm, mu))  # fmt: skip
        for joint in (slide, spin):
            joint.max_bias = 0.0
            self.space.add(joint)
        self._floor.append((slide, spin))
        return body

    # -- one quantum -------------------------------------------------------------------------------------------------

    def step(self, wheels: Sequence[tuple[float, float]]) -> None:
        """Run one quantum with the commanded values (left, right) of each robot's drive."""
        self._draw_noise()
        self._wheels[:] = np.reshape(wheels, (-1, 2))
        self._run_quantum(self._at, self._wheels_at)
        self.ticks += 1
        self.poses = self._read()

    def run_quanta(self, speeds: int, room: int, count: int) -> list[PoseBlock]:
        """Run `count` quanta with the wheel speeds stored by `Wheels`; return the blocks of poses at their ends.

        `speeds` is the address of an array with one pointer per robot, to a ring buffer with speeds of `room` quanta.
        """
        made = []
        while count:
            self._draw_noise()
            row = self._free_row()
            more = min(count, self._noise_ticks - self.ticks % self._noise_ticks, ROWS - row)
            at = self._sheet_at + row * self._row_bytes
            self._run_quanta(self._at, speeds, room, self.ticks, more, self._wheels_at, at, self._width)
            made.append(PoseBlock(self.ticks + 1, self.ticks + more, self._sheet, row, at))
            self._row += more
            self.ticks += more
            count -= more
        if made:
            self.poses = self.poses_in(made[-1], self.ticks)
        return made

    def prepare_native(self, now: Poses, before: Poses, is_enabled: bool = True) -> None:
        """Fill `self.native` with the number of quanta that native code may run, and with addresses of poses.

        Native code may run until new wheel noise must be drawn or the pose buffer is full, and no quantum unless
        `is_enabled`. `now` are the current poses, `before` those one quantum earlier.
        """
        native, row = self.native, self._free_row()
        noisy = self.ticks % self._noise_ticks
        can_run = is_enabled and (noisy or not any(self._noises))
        more = min(self._noise_ticks - noisy, ROWS - row) if can_run else 0
        native.ticks, native.limit = self.ticks, self.ticks + more
        native.row, native.now, native.before = self._sheet_at + row * self._row_bytes, now.address, before.address

    def collect_native(self) -> list[PoseBlock]:
        """Account for the quanta that native code has run since `prepare_native`; return their poses."""
        ticks, count = self.native.ticks, self.native.ticks - self.ticks
        if not count:
            return []
        made = PoseBlock(self.ticks + 1, ticks, self._sheet, self._row, self._sheet_at + self._row * self._row_bytes)
        self._row += count
        self.ticks = ticks
        self.poses = self.poses_in(made, ticks)
        return [made]

    def poses_in(self, block: PoseBlock, tick: int) -> Poses:
        """Return the poses after `tick` quanta, which must be in the block."""
        row = tick - block.first
        at = block.address + row * self._row_bytes
        return Poses.of(block.sheet[block.row + row], len(self.robots), len(self._polygons), at)

    def _free_row(self) -> int:
        """Return a free row for poses. Rows are never written twice, because `Poses` are immutable."""
        if self._row == len(self._sheet):
            self._sheet, self._row = np.empty((ROWS, self._width)), 0
            self._sheet_at = self._sheet.ctypes.data
        return self._row

    def move(self, body: pymunk.Body, x: float, y: float, heading: float | None = None) -> None:
        """Move a robot or object to another pose, at rest; cm, rad."""
        body.position, body.velocity, body.angular_velocity = (x, y), (0.0, 0.0), 0.0
        if heading is not None:
            body.angle = heading
        self.space.reindex_shapes_for_body(body)
        self.poses = self._read()

    def _draw_noise(self) -> None:
        """Draw new noise of the drives if its period has ended."""
        if self.ticks % self._noise_ticks:
            return
        for robot, rng, share in zip(self._robots, self._wheel_rng, self._noises, strict=True):
            if share:
                robot.noise[:] = rng.uniform(1 - share, 1 + share, 2).tolist()

    def _read(self) -> Poses:
        """Return the current poses."""
        row = self._free_row()
        self._row += 1
        at = self._sheet_at + row * self._row_bytes
        self._read_poses(self._at, at)
        return Poses.of(self._sheet[row], len(self.robots), len(self._polygons), at)

    @property
    def seconds(self) -> float:
        """Time since the start of the trial."""
        return self.seconds_at(self.ticks)

    def seconds_at(self, tick: int) -> float:
        """Return the time at the start of quantum `tick`."""
        return tick * self.scene.clock.quantum_tcy / 14_745_600

    def object_poses(self) -> list[Place]:
        """Return x and y of each object in cm; for a polygon, also its heading in rad."""
        headings = iter(self.poses.headings)
        return [(*place, next(headings)) if self.scene.kind_of(number).polygon else place
                for number, place in enumerate(self.poses.objects)]  # fmt: skip

    def object_places(self) -> NDArray[np.float64]:
        """Return the centres of the objects, n x 2, cm."""
        return np.array(self.poses.objects, dtype=float).reshape(-1, 2)
