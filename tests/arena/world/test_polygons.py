"""Movable polygons: floor friction, rotation, camera, infrared light, record and drawing."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arena.camera.appearance import OBJECT, WALL
from arena.camera.line_of_sight import LineOfSight
from arena.camera.renderer import Renderer
from arena.cli import main
from arena.infrared.propagation import Optics
from arena.replay.page import trial_data
from arena.replay.video import frames
from arena.scene import dimensions, geometry
from arena.scene.loader import Scene, SceneError, load_scene
from arena.trial.record import read_trial
from arena.world.physics import World
from arena.world.poses import Poses
from tests.arena.reference_camera import ReferenceCamera, sensor_of

BOX = """
name = "box"
[arena]
width_cm = 300
height_cm = 200
[chassis]
wheel_noise = 0.0
[[robots]]
count = ROBOTS
place = "uniform"
x_cm = 60
width_cm = 80
[[objects]]
name = "box"
polygon = [[0, 0], [20, 0], [20, 30], [0, 30]]
place = "poses"
poses = [[150, 100, 0]]
mass_kg = MASS
[clock]
scripted_quantum_ms = 10
quantum_ms = 10
"""


def scene_with(tmp_path: Path, mass: float = 0.3, robots: int = 2, **texts: str) -> Scene:
    """Return the scene of a box of 20 x 30 cm and some robots, with parts of its text replaced."""
    text = BOX.replace("MASS", str(mass)).replace("ROBOTS", str(robots))
    for old, new in texts.items():
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "box.toml"
    path.write_text(text)
    return load_scene(str(path))


def drive(world: World, wheels: list[tuple[float, float]], seconds: float) -> None:
    for _ in range(round(seconds / world.dt)):
        world.step(wheels)


@pytest.mark.parametrize(("mass", "robots", "moves"), [(0.17, 1, True), (0.18, 1, False), (0.34, 2, True)])
def test_robots_push_a_box_as_heavy_as_their_thrust_allows(
    tmp_path: Path, mass: float, robots: int, moves: bool
) -> None:
    """A thrust of 1.0 N overcomes the floor friction of 1.0 / (0.58 g) = 0.1757 kg; two robots push twice as much."""
    scene = scene_with(tmp_path, mass, robots)
    sides = [100.0] if robots == 1 else [92.0, 108.0]
    world = World.of(scene, 1, [(130.0, y, 0.0) for y in sides], [(150.0, 100.0, 0.0)])
    drive(world, [(6.0, 6.0)] * robots, 4)
    before = world.poses.objects[0][0]
    drive(world, [(6.0, 6.0)] * robots, 1)
    assert (world.poses.objects[0][0] - before > 5) == moves
    assert world.poses.headings[0] == pytest.approx(0.0, abs=0.01)


def test_a_spinning_box_stops_by_the_friction_of_an_even_pressure(tmp_path: Path) -> None:
    """Friction torque is mu m g times the mean distance of the floor points from the centre, so the spin ends after
    omega I / torque, and the box turns by half of omega times that."""
    scene = scene_with(tmp_path)
    kind = scene.kind_of(0)
    world = World.of(scene, 1, [(30.0, 30.0, 0.0), (60.0, 30.0, 0.0)], [(150.0, 100.0, 0.0)])
    corners = np.array(geometry.centred(kind.polygon))
    grid = np.stack(np.meshgrid(np.linspace(-10, 10, 401), np.linspace(-15, 15, 601)), axis=-1).reshape(-1, 2)
    torque = kind.mass_kg * dimensions.GRAVITY * kind.floor_friction * float(np.hypot(*grid.T).mean())
    moment = kind.mass_kg * (20**2 + 30**2) / 12
    world.objects[0].angular_velocity = omega = 4.0
    drive(world, [(0.0, 0.0)] * 2, 1)
    half_a_step = omega * world.dt / 2
    assert world.poses.headings[0] == pytest.approx(omega**2 * moment / torque / 2 + half_a_step, rel=0.01)
    assert corners.mean(axis=0) == pytest.approx([0, 0], abs=1e-12)


def test_an_off_centre_push_turns_a_box_that_rests_before_and_after(tmp_path: Path) -> None:
    """A robot that pushes near a corner turns the box. Left out of the solver while it rests, the box has the same
    pose, to the bit."""
    scene = scene_with(tmp_path, 0.1)
    quick, plain = (World.of(scene, 1, [(110.0, 112.0, 0.0), (40.0, 30.0, 0.0)], [(150.0, 100.0, 0.0)])
                    for _ in range(2))  # fmt: skip
    rested = []
    for speed in (0.0, 12.8, -12.8):
        for _ in range(300):
            quick.step([(speed, speed), (0.0, 0.0)])
            plain._world.steps = 0  # never a multiple of the rest period, so that no object rests
            plain.step([(speed, speed), (0.0, 0.0)])
            assert quick.poses.values.tobytes() == plain.poses.values.tobytes()
        rested.append(bool(quick._discs[2].is_resting))
    assert rested == [True, False, True]
    assert quick.poses.headings[0] < -0.3


@pytest.mark.parametrize("range_cm", [60.0, math.inf])
def test_the_camera_sees_boxes_as_the_reference_does(tmp_path: Path, range_cm: float) -> None:
    """Renderer and reference camera agree for random poses of a box and robots, within range and beyond."""
    scene = scene_with(tmp_path, 0.3, 3).with_values(camera__range_cm=range_cm)
    rng, columns = np.random.default_rng(4), np.arange(0, 640, 17)
    kinds: set[int] = set()
    for _ in range(25):
        robots = [(float(rng.uniform(20, 280)), float(rng.uniform(20, 60)), float(rng.uniform(-3, 3))) for _ in "abc"]
        poses = Poses(robots, [(150.0, 110.0, float(rng.uniform(-3, 3)))])
        camera, renderer = ReferenceCamera(scene, poses, 0), Renderer(scene, 0)
        renderer.set_viewpoint(poses)
        assert LineOfSight(scene, 0).look(poses) == sensor_of(camera)
        for row in (150, 216, 238, 245, 262):
            slow = [camera.column(int(u), (row,))[0] for u in columns]
            assert renderer.classify_row(row, columns).tolist() == slow
            kinds |= set(slow)
    assert kinds >= {OBJECT, WALL}


def test_infrared_light_meets_the_turned_sides_of_a_box(tmp_path: Path) -> None:
    """A sensor measures the distance and the angle of a turned box, and the box blocks light between robots."""
    scene = scene_with(tmp_path)
    optics, up = Optics(scene), math.pi / 2
    half = math.sqrt(2) / 2
    at = (150.0 - 10.0 / half - 8.7, 100.0, up)  # sensor 2 faces right, 5 cm before the turned side on the axis
    flat = optics.surfaces(Poses([(131.3, 100.0, up), (20.0, 20.0, 0.0)], [(150.0, 100.0, 0.0)]), 0)[2]
    askew = optics.surfaces(Poses([at, (20.0, 20.0, 0.0)], [(150.0, 100.0, math.pi / 4)]), 0)[2]
    assert flat == pytest.approx((50.0, 0.8))
    assert askew == pytest.approx((50.0, 0.8 * half))
    for heading, blocks in ((0.0, True), (up, False)):
        poses = Poses([(138.0, 112.0, 0.0), (162.0, 112.0, 0.0)], [(150.0, 100.0, heading)])
        assert bool(optics.signals(poses, 0, [1])) is not blocks
    with pytest.raises(ValueError, match="0 polygons are not those of the scene's first 1 objects"):
        optics.surfaces(Poses([(9.0, 9.0, 0.0)], [(150.0, 100.0)]), 0)


def test_a_record_holds_the_heading_and_pages_and_films_draw_the_outline(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`oN_heading` is a column of the record; replay page and film get poses with heading and the corners."""
    scene_with(tmp_path)
    out = tmp_path / "run"
    assert main(["run", str(tmp_path / "box.toml"), "--brain", "scripted", "--trials", "1", "--minutes", "0.05",
                 "--out", str(out), "--jobs", "1"]) == 0  # fmt: skip
    trial = read_trial(out / "trial-0001.parquet")
    assert trial.object_poses[0] == [(150.0, 100.0, 0.0)]
    assert trial.columns["o0_heading"].shape == trial.times.shape
    kind: dict[str, Any] = trial_data(trial)["kinds"][0]
    assert json.loads(json.dumps(kind["polygon"])) == [[-10, -15], [10, -15], [10, 15], [-10, 15]]
    picture = next(frames(trial, [0.0]))
    outside, inside = (picture.getpixel((round(1.6 * x), round(1.6 * 100))) for x in (136, 145))
    assert outside == (255, 255, 255)
    assert inside != outside
    assert main(["bundle", str(tmp_path / "box.zip"), str(out), "--light"]) == 0
    assert main(["verify", str(tmp_path / "box.zip")]) == 0
    assert "equal to the byte" in capsys.readouterr().out


@pytest.mark.parametrize(("old", "new", "message"), [
    ("[20, 30], ", "[5, 5], [20, 30], ", "objects.polygon: a movable polygon must be convex"),
    ("[20, 0], [20, 30]", "[20, 30], [20, 0]", "objects.polygon: its sides cross"),
    ("mass_kg", "radius_cm = 4\nmass_kg", "objects.radius_cm has no effect beside `polygon`"),
    ("polygon = [[0, 0], [20, 0], [20, 30], [0, 30]]", "", "an object without a polygon is a disc: [x, y]"),
])  # fmt: skip
def test_wrong_polygons_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    """The message names the line, the key and what a movable polygon must be."""
    with pytest.raises(SceneError, match=r"box\.toml:\d+: ") as error:
        scene_with(tmp_path, **{old: new})
    assert message in str(error.value)


def test_a_set_polygon_replaces_that_of_the_scene(tmp_path: Path) -> None:
    """`--set objects.polygon=[[...]]` gives a box of another size; a radius has no effect and is refused."""
    from arena.commands.options.plan import with_overrides

    scene = scene_with(tmp_path)
    wide = with_overrides(scene, ["objects.polygon=[[0,0],[40,0],[40,30],[0,30]]"])
    assert wide.kind_of(0).radius_cm == pytest.approx(25.0)
    with pytest.raises(SceneError, match=r"objects\.radius_cm has no effect in this scene; change `polygon`"):
        with_overrides(scene, ["objects.radius_cm=4"])
