"""Scenes with several kinds of bodies: loading, errors with line numbers, placement, cameras and sensors."""

from __future__ import annotations

import math
import random
from pathlib import Path

import numpy as np
import pytest

from arena.camera.appearance import FLOOR, OBJECT, WALL, appearance_of, colours_of
from arena.camera.line_of_sight import LineOfSight
from arena.camera.renderer import Renderer
from arena.campaign.campaign import Plan
from arena.cli import main
from arena.infrared.propagation import Optics
from arena.infrared.ring import ambient
from arena.robots.controller import ScriptedController
from arena.scene import dimensions, geometry
from arena.scene.loader import FCY, Scene, SceneError, load_scene, scene_of
from arena.scene.schema import NAMED
from arena.trial.record import read_trial
from arena.world.physics import World
from arena.world.poses import Poses
from tests.arena.reference_camera import ReferenceCamera, sensor_of

FULL = """name = "yard"
description = "everything a scene can have"

[arena]
polygon = [[0, 0], [300, 0], [300, 120], [180, 120], [180, 240], [0, 240]]

[chassis]
wheel_noise = 0.0

[[robots]]
name = "workers"
count = 3
place = "uniform"
x_cm = 90
y_cm = 60
width_cm = 160
depth_cm = 100
id_first = 10
controller = "B"

[[robots]]
name = "scout"
place = "poses"
poses = [[40, 200, 90]]
image = "scripted"

[[objects]]
name = "food"
count = 4
place = "normal"
x_cm = 240
y_cm = 60
sd_cm = 20
radius_cm = 3
colour = "blue"

[[objects]]
name = "tall"
place = "poses"
poses = [[100, 200], [130, 200]]
height_cm = 30
colour = "red"

[[obstacles]]
name = "block"
polygon = [[150, 20], [170, 20], [170, 50], [150, 50]]
height_cm = 4
colour = "yellow"

[[obstacles]]
name = "pillar"
x_cm = 60
y_cm = 150
radius_cm = 8
colour = "black"
share = 0.2

[[patches]]
name = "nest"
polygon = [[0, 0], [50, 0], [50, 50], [0, 50]]
colour = "white"

[[patches]]
name = "spot"
x_cm = 240
y_cm = 60
radius_cm = 30
colour = "#204060"

[[lamps]]
x_cm = 25
y_cm = 25
counts = 2000
"""


@pytest.fixture
def yard(tmp_path: Path) -> Scene:
    """Return the scene FULL, loaded from a file."""
    path = tmp_path / "yard.toml"
    path.write_text(FULL)
    return load_scene(str(path))


def test_a_scene_of_several_kinds_is_read(yard: Scene) -> None:
    """Groups of a scene keep their order and values, and the metadata of a record restore the same scene."""
    assert (yard.robots.count, yard.objects.count) == (4, 6)
    assert (yard.arena.width_cm, yard.arena.height_cm) == (300, 240)
    assert [yard.id_of(robot) for robot in range(4)] == [10, 11, 12, 0]
    assert [yard.group_of(robot).name for robot in range(4)] == ["workers"] * 3 + ["scout"]
    assert [yard.kind_of(number).name for number in range(6)] == ["food"] * 4 + ["tall"] * 2
    plan = Plan(yard, "scripted", "A", None, 1, 1.0, 1, None, (("scripted", None),))
    assert repr(scene_of(plan.key()["scene"])) == repr(yard)  # nan is not equal to itself


def test_a_scene_with_robot_groups_has_only_the_objects_it_lists(tmp_path: Path) -> None:
    """A scene with robot groups has only the objects it lists; the built-in scenes have the objects of their files."""
    path = tmp_path / "few.toml"
    path.write_text('name = "few"\n[[robots]]\ncount = 2\n')
    assert load_scene(str(path)).objects.count == 0
    assert [load_scene(name).objects.count for name in ("aggregation", "avoidance", "foraging")] == [0, 0, 6]
    path.write_text('name = "few"\n')
    assert (load_scene(str(path)).robots.count, load_scene(str(path)).objects.count) == (5, 20)


def test_bodies_are_placed_without_contacts_where_the_groups_say(yard: Scene) -> None:
    """Bodies are placed without contacts in the areas of their groups; the same seed gives the same positions."""
    for seed in range(20):
        poses = World(yard, seed).poses
        assert poses.robots == World(yard, seed).poses.robots
        assert poses.robots[3] == pytest.approx((40, 200, math.pi / 2))
        assert poses.objects[4:] == [(100, 200), (130, 200)]
        discs = [(x, y, dimensions.ROBOT_RADIUS) for x, y, _ in poses.robots]
        discs += [(x, y, yard.kind_of(number).radius_cm) for number, (x, y) in enumerate(poses.objects)]
        outline = geometry.sides(yard.arena.polygon) + geometry.sides(yard.obstacles[0].polygon)
        for number, (x, y, radius) in enumerate(discs):
            assert geometry.contains(yard.arena.polygon, x, y)
            assert all(geometry.distance_to(x, y, side) >= radius for side in outline)
            assert math.hypot(x - 60, y - 150) >= radius + 8
            assert all(math.hypot(x - ox, y - oy) >= radius + other for ox, oy, other in discs[:number])
        assert all(10 <= x <= 170 and 10 <= y <= 110 for x, y, _ in poses.robots[:3])


@pytest.mark.parametrize("pitch", [0.0, -4.0])
def test_renderer_and_reference_camera_agree_in_a_furnished_scene(yard: Scene, pitch: float) -> None:
    """Renderer and reference camera agree from random viewpoints in a scene with obstacles, heights, patches and a
    room with an inner corner."""
    scene = yard.with_values(camera__pitch_deg=pitch)
    rng = np.random.default_rng(8)
    columns = np.arange(0, 640, 13)
    kinds: set[int] = set()
    for seed in range(60):
        poses = World(scene, seed).poses
        x, y, _ = poses.robots[seed % 4]
        pose = x, y, float(rng.uniform(-math.pi, math.pi))
        turned = Poses([pose if robot == seed % 4 else one for robot, one in enumerate(poses.robots)], poses.objects)
        camera, renderer = ReferenceCamera(scene, poses, seed % 4, pose), Renderer(scene, seed % 4)
        renderer.set_viewpoint(turned)
        assert LineOfSight(scene, seed % 4).look(turned) == sensor_of(camera)
        for row in (30, 208, 216, 238, 245, 255, 262, 300, 420):
            slow = [camera.column(int(u), (row,))[0] for u in columns]
            assert renderer.classify_row(row, columns).tolist() == slow, f"seed {seed}, row {row}"
            kinds |= set(slow)
    assert kinds >= {OBJECT, WALL, FLOOR} | set(range(6, len(appearance_of(scene).colours)))


def test_the_camera_shows_colours_and_heights(yard: Scene) -> None:
    """A low block hides the floor behind it but not the wall; a patch is visible at its position."""
    colours = [tuple(one) for one in colours_of(yard).tolist()]
    yellow, blue = colours.index(NAMED["yellow"]), colours.index(NAMED["blue"])
    camera = ReferenceCamera(yard, Poses([(100.0, 35.0, 0.0)] * 4, [(300.0, 300.0)] * 6), 0)
    assert camera.column(320, (240, 250, 200)) == [yellow, yellow, WALL]
    appearance = appearance_of(yard)
    assert appearance.floor_at(240, 60) == colours.index((0x20, 0x40, 0x60))
    assert appearance.floor_at(20, 20) == colours.index(NAMED["white"])
    assert appearance.floor_at(100, 100) == FLOOR
    assert appearance.sensor_classes[blue] == 0  # the line-of-sight sensor detects only red and green


def test_obstacles_stop_a_robot(yard: Scene) -> None:
    """A robot stops at a block, at a pillar and at the inner corner of the room."""
    for start, end in (((110, 35, 0.0), (150, 35)), ((60, 110, math.pi / 2), (60, 142)), ((120, 180, 0.0), (180, 180))):
        world = World.of(yard, 1, [start, *[(20.0 + 20 * n, 20.0, 0.0) for n in range(3)]],
                         [(250.0, 10 + 15 * n) for n in range(6)])  # fmt: skip
        for _ in range(20_000):
            world.step([(12.8, 12.8), *[(0.0, 0.0)] * 3])
        x, y, _ = world.poses.robots[0]
        assert math.hypot(x - end[0], y - end[1]) == pytest.approx(dimensions.ROBOT_RADIUS, abs=0.1)


def test_infrared_sensors_detect_obstacles_and_all_lamps(yard: Scene) -> None:
    """Infrared sensors measure distance and reflection of a block, a black pillar and a wall of the polygon, and the
    light of all lamps."""
    far = [(300.0, 300.0)] * 6
    for pose, gap, share in (
        ((150 - 3.7 - 4, 35.0, math.radians(18)), 40, 1.0),  # sensor 0, which is 18 degrees to the right, faces along x
        ((60 - 8 - 3.7 - 5, 150.0, math.radians(18)), 50, 0.2),
        ((180 - 3.7 - 6, 200.0, math.radians(18)), 60, 1.0),
    ):
        found = Optics(yard).surfaces(Poses([pose, *[(20.0, 20.0, 0.0)] * 3], far), 0)[0]
        assert found.millimetres == pytest.approx(gap, abs=0.5)
        assert found.share == pytest.approx(share, abs=0.01)
    lit = ambient(yard, (25 + 100, 25.0, math.pi + math.radians(18)))
    assert lit[0] == pytest.approx(3800 - 2000, abs=5)
    two = Poses([(130.0, 35.0, 0.0), (190.0, 35.0, math.pi), (20.0, 20.0, 0.0), (20.0, 60.0, 0.0)], far)
    near = Poses([(130.0, 90.0, 0.0), (150.0, 90.0, math.pi), (20.0, 20.0, 0.0), (20.0, 60.0, 0.0)], far)
    assert [bool(Optics(yard).signals(poses, 0, [1])) for poses in (two, near)] == [False, True]


@pytest.mark.parametrize(
    ("change", "line", "words"),
    [
        (("count = 3", "count = 3\nheading_deg = inf"), 13, "robots.heading_deg is inf; expected -1e6 to 1e6"),
        (("count = 3", "count = -3"), 12, "robots.count is -3; expected 0 to 10000"),
        (("radius_cm = 3", f"radius_cm = 3{'0' * 400}"), 34, "objects.radius_cm: the number is too large"),
        (("x_cm = 240", "x_cm = inf"), 31, "objects.x_cm is inf; expected -10000 to 10000"),
        (("[[40, 200, 90]]", "[[40, 200, 90]]\ncount = 2"), 25, "robots.count is 2, but 1 poses are listed; remove it"),
        (("radius_cm = 3", 'radius_cm = "big"'), 34, "objects.radius_cm is 'big'; expected float"),
        (("height_cm = 30", "height = 30"), 41, "unknown key objects.height; expected"),
        (('place = "normal"', 'place = "gauss"'), 30, "objects.place is 'gauss'; expected marks, uniform"),
        (('colour = "black"', 'colour = "pink"'), 55, "obstacles.colour is 'pink'; expected red,"),
        (("[170, 50], [150, 50]]", "[150, 50], [170, 50]]"), 46, "obstacles.polygon: its sides cross"),
        (("[50, 50], [0, 50]]", "[50]]"), 60, "patches.polygon: [50]: expected a point [x, y]"),
        (("poses = [[40, 200, 90]]", ""), 23, 'robots.poses goes with place = "poses"'),
        (("counts = 2000", "counts = 2000\n[start]\noff = [[1, 2], [4, 1]]"), 75, "start.off: ['4', '1']: expected a"),
        (("counts = 2000", "counts = 2000\n[start]\noff = [[1, 2], [1, 1]]"), 75, "start.off: ['1', '1']: expected a"),
        (("counts = 2000", "counts = 2000\n[infrared]\nlost_share = 2"), 75, "infrared.lost_share is 2.0; expected"),
        (("counts = 2000", "counts = true"), 73, "lamps.counts is True; expected float"),
        (('name = "yard"', 'name = "../yard"'), 1, "name is '../yard'"),
        (("[chassis]\n", "[chassis]\ncount = 3\n"), 8, "chassis.count: the groups determine the number of robots"),
        (("[[lamps]]", "[[lumps]]"), 70, "unexpected 'lumps'; expected name,"),
        (('controller = "B"', "controller = B"), 19, "Invalid value"),
        (('controller = "B"', 'controller = "C"'), 19, "robots.controller is 'C'; expected A, B, the path"),
        (("radius_cm = 8", ""), 50, "obstacles: expected either a polygon or a radius_cm"),
        (("share = 0.2", "share = 2"), 56, "obstacles.share is 2.0; expected 0 to 1"),
        (("[300, 0]", "[-300, 0]"), 5, "arena.polygon"),
    ],
)
def test_errors_name_file_line_and_key(
    change: tuple[str, str], line: int, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each error in a scene ends with exit status 2 and a message with file, line, key and expected values."""
    assert change[0] in FULL
    path = tmp_path / "my.toml"
    path.write_text(FULL.replace(*change, 1))
    assert main(["run", str(path), "--brain", "scripted", "--minutes", "0.01", "--out", str(tmp_path / "o")]) == 2
    said = capsys.readouterr().err
    assert f"my.toml:{line}: " in said
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("[[100, 200], [130, 200]]", "[[60, 155], [130, 200]]"), "touches obstacle pillar"),
        (("[[100, 200], [130, 200]]", "[[200, 200], [130, 200]]"), "is outside the walls"),
        (("[[100, 200], [130, 200]]", "[[100, 200], [101, 200]]"), "touches what is at (100, 200) cm"),
        (("[[40, 200, 90]]", "[[2, 200, 90]]"), "robot scout at (2, 200) cm is in a wall"),
        (("count = 4", "count = 400"), "no place found in 2000 tries for object food"),
    ],
)
def test_scenes_without_room_are_refused(change: tuple[str, str], words: str, tmp_path: Path) -> None:
    """A scene without room for a body is refused; the message names the body, its position and the obstructing body."""
    path = tmp_path / "my.toml"
    path.write_text(FULL.replace(*change, 1))
    with pytest.raises(SceneError, match="no room") as caught:
        World(load_scene(str(path)), 1)
    assert words in str(caught.value)


def test_five_hundred_mutated_scenes_are_read_or_refused_in_one_line(tmp_path: Path) -> None:
    """500 scenes with exchanged, dropped and doubled words, lines and letters are read, or refused by a SceneError
    that names the file."""
    path = tmp_path / "my.toml"
    pieces = [
        "-1", "1e999", "nan", "[[]]", "{}", '"x"', "[[robots]]", "=", "\x00", "é", "true", "[0, 0]", "99999999999",
        "9" * 400,
    ]  # fmt: skip
    refused = 0
    for seed in range(500):
        rng = random.Random(seed)
        lines = FULL.splitlines()
        for _ in range(rng.randint(1, 4)):
            at = rng.randrange(len(lines))
            line = lines[at]
            kind = rng.randrange(6)
            if kind == 0:
                del lines[at]
            elif kind == 1:
                lines.insert(rng.randrange(len(lines)), line)
            elif kind == 2 and "=" in line:
                lines[at] = line.partition("=")[0] + "= " + rng.choice(pieces)
            elif kind == 3 and line:
                cut = rng.randrange(len(line))
                lines[at] = line[:cut] + rng.choice(pieces) + line[cut + 1 :]
            elif kind == 4:
                other = rng.randrange(len(lines))
                lines[at], lines[other] = lines[other], line
            else:
                lines[at] = rng.choice(pieces)
            if len(lines) < 2:
                break
        path.write_bytes("\n".join(lines).encode()[: rng.choice((None, 200, 700))])
        said = _refusal(path)
        refused += bool(said)
        assert not said or "my.toml:" in said or "no room" in said, f"seed {seed}: {said}"
        assert "\n" not in said, f"seed {seed}: {said}"
    assert 250 < refused < 490


def _refusal(path: Path) -> str:
    """Return why a scene is refused, or an empty text if its world can be built."""
    try:
        World(load_scene(str(path)), 1)
    except SceneError as error:
        return str(error)
    return ""


def test_a_scripted_trial_runs_in_a_furnished_scene(tmp_path: Path) -> None:
    """A scripted trial in a furnished scene runs from `arena run` to page and figures; the record has the poses of
    all bodies."""
    path = tmp_path / "yard.toml"
    path.write_text(FULL)
    out = tmp_path / "out"
    assert main(["run", str(path), "--brain", "scripted", "--trials", "1", "--minutes", "0.2", "--out", str(out)]) == 0
    trial = read_trial(out / "trial-0001.parquet")
    assert trial.scene.patches[0].name == "nest"
    assert trial.robots.shape[1:] == (4, 2)
    assert np.abs(trial.robots[-1] - trial.robots[0]).max() > 5
    assert main(["replay", str(trial.path)]) == 0
    assert main(["plot", str(out), "--out", str(tmp_path)]) == 0
    controller = ScriptedController(trial.scene, 1, 3, "A")
    assert controller.control_step(int(0.5 * FCY / trial.scene.clock.quantum_tcy), World(trial.scene, 1).poses) == (
        0.0,
        0.0,
    )


@pytest.mark.parametrize(
    ("table", "key", "words"),
    [
        ("[arena]", "width_cm", "the number is too large"),
        ("[start]", "selector", "expected "),
        ("[[robots]]", "selector", "expected "),
        ("[objects]", "count", "expected 0 to "),
    ],
)
def test_integers_beyond_the_range_of_float_are_refused(table: str, key: str, words: str, tmp_path: Path) -> None:
    """An integer of 400 digits is refused in every key; float and `math.isnan` cannot represent it."""
    path = tmp_path / "my.toml"
    path.write_text(f'name = "large"\n{table}\n{key} = {"9" * 400}\n')
    with pytest.raises(SceneError, match=words):
        load_scene(str(path))
