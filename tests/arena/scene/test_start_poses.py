"""Start poses: `--start RECORD` begins where a recorded trial ended; numbers in [start] are checked."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pytest
from pyarrow import parquet

from arena.campaign.bundle import pack, verify
from arena.cli import main
from arena.scene.loader import SceneError, load_scene
from arena.scene.schema import ObjectKind, Obstacle
from arena.trial.record import read_trial
from arena.world.physics import World


def run(scene: str, folder: Path, *words: object) -> int:
    command = ["run", scene, "--brain", "scripted", "--minutes", "0.05", "--trials", "1", "--jobs", "1"]
    return main([*command, "--out", str(folder), *map(str, words)])


@pytest.mark.parametrize("scene", ["clustering", "chen2015"])
def test_a_trial_begins_where_another_one_ended(scene: str, tmp_path: Path) -> None:
    """Positions of robots and objects, and headings of robots and polygons, are those of the record's last sample."""
    record = tmp_path / "first" / "trial-0001.parquet"
    assert run(scene, tmp_path / "first") == 0
    assert run(scene, tmp_path / "second", "--start", record, "--seed", 7) == 0
    before, after = read_trial(record), read_trial(tmp_path / "second" / "trial-0001.parquet")
    assert after.robots[0] == pytest.approx(before.robots[-1], abs=1e-9)
    for one, other in zip(after.object_poses[0], before.object_poses[-1], strict=True):
        assert one == pytest.approx(other, abs=1e-9)
    for robot in range(after.scene.robots.count):
        turned = after.columns[f"r{robot}_heading"][0] - before.columns[f"r{robot}_heading"][-1]
        assert math.remainder(turned, math.tau) == pytest.approx(0, abs=1e-4)  # a record has four decimals


def test_a_bundle_of_such_a_run_verifies_without_the_first_record(tmp_path: Path) -> None:
    """The manifest has the poses, so that a bundle does not need the record that they come from."""
    assert run("clustering", tmp_path / "first") == 0
    record = tmp_path / "first" / "trial-0001.parquet"
    assert run("clustering", tmp_path / "second", "--start", record) == 0
    record.unlink()
    pack([tmp_path / "second"], tmp_path / "x.zip")
    assert [check.equal for check in verify(tmp_path / "x.zip", lambda numbers: numbers)] == [True]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--robots", "3"], "clustering: start.robot_poses has 5 poses; expected one for each of 3 bodies"),
        (["--objects", "30"], "clustering: start.object_poses has 20 poses; expected one for each of 30 bodies"),
        (["--set", "arena.width_cm=90"], "cm is outside the walls"),
    ],
)
def test_a_record_of_another_world_is_refused(
    words: list[str], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Other numbers of bodies, and poses outside the walls, end with status 2 and a message that names the key."""
    assert run("clustering", tmp_path / "first") == 0
    assert run("clustering", tmp_path / "second", "--start", tmp_path / "first" / "trial-0001.parquet", *words) == 2
    assert expected in capsys.readouterr().err
    assert not list(tmp_path.glob("second/*.parquet"))


def test_a_record_without_samples_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A record whose columns are empty ends with status 2 and one line that names the file."""
    assert run("clustering", tmp_path / "first") == 0
    record = tmp_path / "first" / "trial-0001.parquet"
    parquet.write_table(parquet.read_table(record).slice(0, 0), record)
    capsys.readouterr()
    assert run("clustering", tmp_path / "second", "--start", record) == 2
    assert capsys.readouterr().err == f"arena: {record}: has no samples, so no poses to start from\n"


def test_a_record_with_many_turns_and_a_damaged_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A robot that has turned for hours starts with the heading it had. A damaged page of a file gives one line."""
    assert run("clustering", tmp_path / "first") == 0
    record = tmp_path / "first" / "trial-0001.parquet"
    table = parquet.read_table(record)
    heading = pa.array([1.0] * (len(table) - 1) + [1.0 + 4000 * math.tau])
    parquet.write_table(table.set_column(table.column_names.index("r0_heading"), "r0_heading", heading), record)
    assert run("clustering", tmp_path / "second", "--start", record) == 0
    assert read_trial(tmp_path / "second" / "trial-0001.parquet").columns["r0_heading"][0] == pytest.approx(1.0)
    damaged = bytearray(record.read_bytes())
    damaged[4:60] = bytes(56)
    record.write_bytes(damaged)
    capsys.readouterr()
    assert run("clustering", tmp_path / "third", "--start", record) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"arena: {record}: is not a recorded trial: ")
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("robot", "thing", "words"),
    [
        ((51, 50), (100, 50), "start.robot_poses: (51, 50) cm touches what is at (50, 50) cm"),
        ((2, 50), (100, 50), "start.robot_poses: (2, 50) cm is in a wall"),
        ((80, 50), (50, 51), "start.object_poses: (50, 51) cm touches what is at (50, 50) cm"),
        ((200, 101), (100, 50), "start.robot_poses: (200, 101) cm touches obstacle post"),
    ],
)
def test_bodies_that_overlap_are_refused(robot: tuple[int, int], thing: tuple[int, int], words: str) -> None:
    """A body in another one, in a wall or in an obstacle of the new scene is named, before any trial."""
    scene = load_scene("clustering").with_values(robots__count=2, objects__count=1)
    posted = replace(scene, obstacles=(Obstacle(name="post", x_cm=200, y_cm=100, radius_cm=4),))
    wrong = posted.with_values(start__robot_poses=[[50, 50, 0], [*robot, 0]], start__object_poses=[thing])
    with pytest.raises(SceneError) as refused:
        World(wrong, 1)
    assert str(refused.value) == f"clustering: {words}"


@pytest.mark.parametrize(
    ("robot", "boxes", "words"),
    [
        ((50, 50), ((100, 50, 0), (200, 50, 45)), ""),
        ((100, 62), ((100, 50, 0), (200, 50, 45)), "start.robot_poses: (100, 62) cm touches what is at (100, 50) cm"),
        ((113.2, 50), ((100, 50, 0), (200, 50, 45)), ""),
        ((50, 50), ((100, 50, 0), (118, 50, 0)), "start.object_poses: (100, 50) cm touches what is at (118, 50) cm"),
        ((50, 50), ((100, 50, 0), (10, 150, 45)), "start.object_poses: (10, 150) cm is outside the walls"),
    ],
)
def test_polygons_that_overlap_are_refused(
    robot: tuple[float, float], boxes: tuple[tuple[float, ...], ...], words: str
) -> None:
    """A robot may touch a side of a box but not overlap it. Two boxes, or a box and a wall, may not overlap either."""
    box = ObjectKind(count=2, polygon=((0, 0), (20, 0), (20, 20), (0, 20)), radius_cm=14.2)
    scene = load_scene("clustering").with_values(robots__count=1, objects__count=2)
    scene = replace(scene, kinds=(box,)).with_values(start__robot_poses=[[*robot, 0]], start__object_poses=boxes)
    if not words:
        assert [len(place) for place in World(scene, 1).object_poses()] == [3, 3]
        return
    with pytest.raises(SceneError) as refused:
        World(scene, 1)
    assert str(refused.value) == f"clustering: {words}"


def test_listed_poses_may_touch_and_have_the_right_size() -> None:
    """Bodies that touch are accepted; a robot needs x, y, degrees."""
    scene = load_scene("clustering").with_values(robots__count=2, objects__count=1)
    touching = scene.with_values(start__robot_poses=[[50, 50, 0], [57, 50, 90]], start__object_poses=[[65.3, 50]])
    world = World(touching, 1)
    assert [round(math.degrees(pose[2])) for pose in world.poses.robots] == [0, 90]
    with pytest.raises(SceneError, match="pose 1 has 2 numbers; expected x, y, degrees"):
        scene.with_values(start__robot_poses=[[50, 50, 0], [57, 50]], start__object_poses=[[60, 50]])
