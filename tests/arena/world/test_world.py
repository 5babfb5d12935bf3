"""The world: units, calibrations of components, repeatability (docs/experiment-appendix.md §3)."""

import copy
import math
import pickle
import random
from array import array
from collections import deque
from ctypes import addressof, c_void_p
from dataclasses import replace

import numpy as np
import pymunk
import pytest

from arena.camera.appearance import NOTHING, OBJECT, ROBOT
from arena.camera.renderer import Renderer
from arena.robots.controller import ScriptedController
from arena.robots.reactive import steps_per_second
from arena.scene import dimensions
from arena.scene.loader import Scene, SceneError, load_scene
from arena.scene.schema import Arena, Obstacle
from arena.trial.trial import run_trial
from arena.world.physics import World
from arena.world.poses import Poses
from arena.world.wheels import ROOM, Wheels


@pytest.fixture
def empty() -> Scene:
    """Return a scene with one robot, no objects, no wheel noise and a quantum of 10 ms."""
    return load_scene("clustering").with_values(
        robots__wheel_noise=0.0, robots__count=1, objects__count=0, clock__quantum_ms=10.0
    )


def drive(world: World, wheels: tuple[float, float], seconds: float) -> None:
    for _ in range(round(seconds / world.dt)):
        world.step([wheels])


def test_full_speed_covers_128_mm_in_a_second(empty: Scene) -> None:
    """epuck.md §3: at 1000 steps/s of 0.128 mm, a robot drives 128 mm in a second."""
    world = World.of(empty, 1, [(50, 150, 0.0)], [])
    drive(world, (12.8, 12.8), 1)
    before = world.poses.robots[0][0]
    drive(world, (12.8, 12.8), 1)
    assert world.poses.robots[0][0] - before == pytest.approx(12.8, abs=1e-3)
    assert world.poses.robots[0][1] == pytest.approx(150, abs=1e-9)


@pytest.mark.parametrize("controller", ["A", "B"])
@pytest.mark.parametrize("seen", [NOTHING, OBJECT, ROBOT])
def test_circles_have_the_radius_of_the_kinematics(empty: Scene, controller: str, seen: int) -> None:
    """epuck.md §8: circles have the radius R = axle/2 (vl + vr)/(vr - vl); controller A without an object drives 7.57
    cm with speeds in whole mm/s."""
    left, right = (steps * dimensions.CM_PER_STEP for steps in steps_per_second(controller, seen))
    world = World.of(empty, 1, [(200, 150, 0.0)], [])
    places = []
    for _ in range(800):
        world.step([(left, right)])
        places.append(world.poses.robots[0][:2])
    path = np.array(places[100:])
    fit = np.linalg.lstsq(np.column_stack([2 * path, np.ones(len(path))]), (path**2).sum(axis=1), rcond=None)[0]
    radius = math.sqrt(fit[2] + fit[0] ** 2 + fit[1] ** 2)
    assert radius == pytest.approx(2.55 * (left + right) / abs(right - left), rel=1e-3)


@pytest.mark.parametrize(("objects", "moves"), [(4, True), (5, True), (6, False)])
def test_one_robot_pushes_five_objects_but_not_six(empty: Scene, objects: int, moves: bool) -> None:
    """experiment-contract.md §1, epuck.md §4: a drive of 1.0 N pushes five objects of 0.199 N each, but not six."""
    scene = empty.with_values(objects__count=objects)
    world = World.of(scene, 1, [(20, 150, 0.0)], [(28.71 + 10 * k, 150) for k in range(objects)])
    drive(world, (12.8, 12.8), 2)
    before = world.poses.robots[0][0]
    drive(world, (12.8, 12.8), 1)
    assert (world.poses.robots[0][0] - before > 10) == moves
    if not moves:
        assert world.poses.robots[0][0] - before < 0.1


@pytest.mark.parametrize(("quantum_ms", "half_a_step"), [(10.0, 0.064), (1.0, 0.0064)])
def test_a_pushed_object_slides_as_friction_allows(empty: Scene, quantum_ms: float, half_a_step: float) -> None:
    """epuck.md §4: an object released at full speed slides by v^2 / (2 mu g), plus half a step of the integrator."""
    scene = empty.with_values(objects__count=1, clock__quantum_ms=quantum_ms)
    world = World.of(scene, 1, [(20, 150, 0.0)], [(28.71, 150)])
    drive(world, (12.8, 12.8), 2)
    before = world.poses.objects[0][0]
    drive(world, (0.0, 0.0), 1)
    slid = world.poses.objects[0][0] - before
    assert slid == pytest.approx(12.8**2 / (2 * dimensions.FLOOR_FRICTION * dimensions.GRAVITY) + half_a_step, abs=0.02)


def test_a_wall_stops_a_robot(empty: Scene) -> None:
    """A robot that drives against a wall stays inside, and its wheels slip."""
    world = World.of(empty, 1, [(390, 150, 0.0)], [])
    drive(world, (12.8, 12.8), 3)
    assert world.poses.robots[0][0] == pytest.approx(400 - dimensions.ROBOT_RADIUS, abs=0.05)


CORNERS = ((0.0, 0.0), (400.0, 0.0), (400.0, 300.0), (0.0, 300.0))
PAIRS = {
    "wall": ({}, [(396.0, 100.0, math.pi / 4)]),
    "room": ({"arena": Arena(polygon=CORNERS)}, [(396.0, 100.0, math.pi / 4)]),
    "polygon": ({"obstacles": (Obstacle(polygon=((200, 50), (300, 50), (300, 280), (200, 280))),)},
                [(196.0, 100.0, math.pi / 4)]),
    "disc": ({"obstacles": (Obstacle(x_cm=200.0, y_cm=150.0, radius_cm=90.0),)}, [(106.3, 152.0, math.pi / 4)]),
    "robot": ({}, [(100.0, 100.0, 0.0), (107.3, 101.5, math.pi / 2)]),
}  # fmt: skip


@pytest.mark.parametrize("pair", PAIRS)
def test_every_pair_of_bodies_has_the_documented_contact_friction(empty: Scene, pair: str) -> None:
    """For every pair of bodies, the ratio of tangential and normal impulse of a sliding contact is
    `CONTACT_FRICTION`."""
    parts, poses = PAIRS[pair]
    scene = replace(empty.with_values(robots__count=len(poses), clock__quantum_ms=1.0), **parts)
    world = World.of(scene, 1, poses, [])
    wheels = [(12.8, 12.8), (-12.8, -12.8)][: len(poses)]
    along = across = 0.0

    def add(arbiter: pymunk.Arbiter) -> None:
        nonlocal along, across
        impulse, normal = arbiter.total_impulse, arbiter.contact_point_set.normal
        across += abs(impulse.dot(normal))
        along += abs(impulse.dot(normal.perpendicular()))

    for _ in range(150):
        world.step(wheels)
        world.robots[0].each_arbiter(add)
    assert across > 0
    assert along / across == pytest.approx(dimensions.CONTACT_FRICTION, rel=0.02)


def test_without_slip_limit_the_drive_is_enkis(empty: Scene) -> None:
    """epuck.md §4: without slip limit, the drive is Enki's velocity override, which pushes what a drive of limited
    force does not."""
    reached = []
    for thrust in (1.0, "inf"):
        scene = empty.with_values(objects__count=8, robots__thrust_n=thrust)
        world = World.of(scene, 1, [(20, 150, 0.0)], [(28.71 + 10 * k, 150) for k in range(8)])
        drive(world, (12.8, 12.8), 2)
        reached.append(world.poses.robots[0][0] - 20)
    assert reached[0] < 1 < 10 < reached[1]


@pytest.mark.parametrize(("quantum_ms", "thrust_n"), [(1.0, 1.0), (10.0, 1.0), (10.0, math.inf)])
def test_objects_at_rest_out_of_the_solver_change_no_position(quantum_ms: float, thrust_n: float) -> None:
    """If objects at rest are omitted from the solver, all positions are equal to the bit, for robots that push crowded
    objects and bodies moved by hand."""
    scene = load_scene("clustering").with_values(
        arena__width_cm=100.0, arena__height_cm=80.0, robots__count=4, robots__thrust_n=thrust_n, objects__count=14,
        clock__quantum_ms=quantum_ms,
    )  # fmt: skip
    draw = random.Random(quantum_ms)
    robots = [(10.0, 10.0, 0.3), (90.0, 10.0, 2.0), (90.0, 70.0, 4.0), (10.0, 70.0, 5.5)]
    objects = [(20.0 + 11.0 * (n % 6), 25.0 + 12.0 * (n // 6)) for n in range(14)]
    quick, plain = (World.of(scene, 1, robots, objects) for _ in range(2))
    resting, roused, before = [], 0, [0] * 18
    for turn in range(60):
        wheels = [(draw.uniform(-6, 12), draw.uniform(-6, 12)) for _ in robots]
        if turn % 20 == 19:
            body, to = draw.choice("ro") + str(draw.randrange(4)), (draw.uniform(10, 90), draw.uniform(10, 70))
            for world in (quick, plain):
                world.move((world.robots if body[0] == "r" else world.objects)[int(body[1])], *to)
        for _ in range(round(0.4 / quick.dt)):
            quick.step(wheels)
            plain._world.steps = 0  # never a multiple of the rest period, so that no object rests
            plain.step(wheels)
            assert quick.poses.values.tobytes() == plain.poses.values.tobytes()
            now = [disc.is_resting for disc in quick._discs]
            roused += sum(one and not other for one, other in zip(before, now, strict=True))
            before = now
        resting.append(sum(before))
    assert not any(disc.is_resting for disc in plain._discs)
    assert max(resting) > 7
    assert roused > 10
    assert max(abs(x - a) for (x, _), (a, _) in zip(quick.poses.objects, objects, strict=True)) > 5


def test_wheel_noise_stays_within_its_share() -> None:
    """epuck.md §4: wheel noise is uniform within 5 %, with a new draw per 0.1 s."""
    scene = load_scene("clustering").with_values(
        objects__count=0, robots__count=1, robots__thrust_n="inf", clock__quantum_ms=10.0
    )
    world = World.of(scene, 3, [(100, 150, 0.0)], [])
    speeds = []
    for _ in range(300):
        before = world.poses.robots[0]
        world.step([(6.4, 6.4)])
        after = world.poses.robots[0]
        speeds.append(math.dist(before[:2], after[:2]) / world.dt)
    assert 0.95 * 6.4 - 0.01 <= min(speeds) < 0.98 * 6.4 < 1.02 * 6.4 < max(speeds) <= 1.05 * 6.4 + 0.01
    assert len({round(speed, 6) for speed in speeds}) <= 31


def test_two_runs_of_a_trial_are_equal_to_the_bit() -> None:
    """engines.md §7: a seed determines all random numbers, so two runs of a trial are equal to the bit."""
    scene = load_scene("clustering").with_values(clock__quantum_ms=10.0)
    rows = [run_trial(scene, 5, [ScriptedController(scene, 5, i, "A") for i in range(5)], 20).rows for _ in range(2)]
    other = run_trial(scene, 6, [ScriptedController(scene, 6, i, "A") for i in range(5)], 20).rows
    assert rows[0].columns == rows[1].columns
    assert rows[0].columns["r0_x"] != other.columns["r0_x"]


def test_bodies_start_on_marks_without_overlap() -> None:
    """epuck.md §8: bodies start without overlap on 165 marks, which are 25 cm apart."""
    poses = World(load_scene("clustering"), 1).poses
    places = [pose[:2] for pose in poses.robots] + poses.objects
    assert len(set(places)) == 25
    assert all((x - 25) % 25 == 0 and (y - 25) % 25 == 0 for x, y in places)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"objects__count": 161}, "no room: 166 robots and objects on 165 marks"),
        ({"objects__radius_cm": 30.0}, "no room"),
        ({"marks__spacing_cm": 5.0}, "no room: marks are 5 cm apart"),
        ({"robots__count": -1}, "robots.count is -1; expected 0 to 10000"),
        ({"robots__wheels": 3}, "no scene value robots.wheels"),
        ({"objects__mass_kg": "heavy"}, "objects.mass_kg is 'heavy'; expected float"),
    ],
)
def test_impossible_scenes_are_refused_with_the_reason(values: dict[str, object], message: str) -> None:
    """An impossible scene is refused with a message that names the value and the expectation."""
    with pytest.raises(SceneError, match=message):
        World(load_scene("clustering").with_values(**values), 1)


@pytest.mark.parametrize("quantum_ms", [1.0, 10.0])
@pytest.mark.parametrize("thrust_n", [1.0, 0.5])
def test_a_robot_cannot_push_another_one_at_rest(quantum_ms: float, thrust_n: float) -> None:
    """epuck.md §3: a robot at rest starts to slip at 0.7 m g = 1.04 N, more than the drive of 1.0 N, so both robots
    come to rest."""
    values = {"clock__quantum_ms": quantum_ms, "robots__wheel_noise": 0.0, "robots__thrust_n": thrust_n}
    scene = load_scene("clustering").with_values(robots__count=2, objects__count=0, **values)
    world = World.of(scene, 1, [(100, 150, 0.0), (120, 150, 1.0)], [])
    steps = round(1 / world.dt)
    places = []
    for _ in range(10):
        for _ in range(steps):
            world.step([(12.8, 12.8), (0.0, 0.0)])
        places.append(world.poses.robots[1][0])
    assert places[-1] - 120 < 4
    assert places[-1] - places[-2] == pytest.approx(0, abs=1e-3)


def test_a_stronger_drive_pushes_a_robot_at_rest() -> None:
    """A drive of 1.5 N, as in ARGoS, pushes a robot at rest, because it exceeds the robot's grip."""
    scene = load_scene("clustering").with_values(robots__wheel_noise=0.0, robots__thrust_n=1.5, robots__count=2,
                                                 objects__count=0)  # fmt: skip
    world = World.of(scene, 1, [(100, 150, 0.0), (120, 150, 1.0)], [])
    for _ in range(5000):
        world.step([(12.8, 12.8), (0.0, 0.0)])
    assert world.poses.robots[1][0] > 150


def test_speeds_are_means_over_the_last_quanta() -> None:
    """Measured speeds are the steps of the last ten quanta of 1 ms over their time, whatever the pieces in which
    steps arrive."""
    rng = random.Random(7)
    quantum = 14_746
    wheels, counts = Wheels(quantum), deque([(0, 0)], maxlen=11)
    made, tick = (0, 0), 0
    while tick < ROOM + 200:
        new = []
        for _ in range(rng.randrange(1, 9)):
            made = made[0] + rng.choice((-1, 0, 0, 1)), made[1] + rng.choice((0, 1))
            new.append(made)
        wheels.add_steps(tick, array("q", [count for pair in new for count in pair]))
        for left, right in new:
            counts.append((left, right))
            rate = dimensions.CM_PER_STEP * 14_745_600 / (quantum * (len(counts) - 1))
            assert wheels.speed(tick) == ((left - counts[0][0]) * rate, (right - counts[0][1]) * rate)
            tick += 1
    wheels.set_stopped(tick)
    assert wheels.speed(tick) == (0.0, 0.0)


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda poses: pickle.loads(pickle.dumps(poses))])
def test_copied_poses_have_the_address_of_the_copy(again) -> None:
    """A copy of the poses has its own address, because native code reads poses by address."""
    poses = World(load_scene("clustering"), 1).poses
    copied = again(poses)
    assert (copied.robots, copied.objects, copied.counts) == (poses.robots, poses.objects, poses.counts)
    assert copied.address == copied.values.ctypes.data


@pytest.mark.parametrize(("robots", "objects"), [(3, 0), (0, 3), (3, 3)])
def test_a_camera_refuses_more_bodies_than_its_scene_has(robots: int, objects: int) -> None:
    """A camera refuses more robots or more objects than its scene has."""
    renderer = Renderer(load_scene("clustering").with_values(robots__count=2, objects__count=2), 0)
    with pytest.raises(ValueError, match=f"{robots} robots and {objects} objects are more than the scene has"):
        renderer.set_viewpoint(Poses([(9.0 * n, 9.0, 0.0) for n in range(robots)], [(50.0, 50.0)] * objects))


def test_quanta_in_a_row_equal_single_quanta() -> None:
    """`run_quanta` gives the poses of single quanta at the same speeds, also across the draws of the wheel noise."""
    scene = load_scene("clustering").with_values(robots__count=2, objects__count=5, robots__wheel_noise=0.02)
    rows, one = World(scene, 3), World(scene, 3)
    wheels = [Wheels(scene.clock.quantum_tcy) for _ in range(2)]
    for robot, speeds in enumerate(wheels):
        speeds.add_steps(0, array("q", [count for tick in range(900) for count in (tick // 3, tick // (2 + robot))]))
    addresses = (c_void_p * 2)(*(speeds.address for speeds in wheels))
    for count in (1, 7, 300, 592):
        for block in rows.run_quanta(addressof(addresses), ROOM, count):
            for tick in range(block.first, block.last + 1):
                one.step([speeds.speed(one.ticks) for speeds in wheels])
                poses = rows.poses_in(block, tick)
                assert poses.values.tolist() == one.poses.values.tolist()
                assert poses.address == poses.values.ctypes.data
    assert (rows.ticks, rows.poses.counts) == (900, (2, 5, 0))
    assert rows.poses.robots != World(scene, 3).poses.robots
