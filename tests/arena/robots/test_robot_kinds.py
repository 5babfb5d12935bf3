"""The interface of a kind of robot, with a third kind: a scripted point that has a body, a drive and an engine."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from arena.camera.appearance import ROBOT
from arena.camera.renderer import Renderer
from arena.cli import main
from arena.infrared.propagation import Optics
from arena.robots.controller import ControllerWithoutUart, Program, Reading
from arena.scene.loader import Scene, SceneError, load_scene
from arena.scene.robot_kind import KINDS, Drive, RobotKind, Traits
from arena.trial.record import read_trial
from arena.world.physics import World
from arena.world.poses import Poses

RADIUS, HEIGHT = 0.5, 3.0
SCENE = """name = "mixed"
[start]
remote = ""
[chassis]
wheel_noise = 0.0
[[robots]]
kind = "point"
place = "poses"
poses = [[100, 100, 0], [100, 120, 90]]
[[robots]]
place = "poses"
poses = [[200, 200, 0]]
"""


class Point(ControllerWithoutUart):
    """Drives ahead at 2 cm/s times its number, counted from 1."""

    def __init__(self, robot: int) -> None:
        self._speed = 2.0 * (robot + 1)

    def control_step(self, tick: int, poses: Poses) -> tuple[float, float]:
        return self._speed, self._speed

    def reading(self) -> Reading:
        return Reading(leds=7)


def controllers(
    scene: Scene, seed: int, robots: Sequence[int], programs: Sequence[Program], channel: object
) -> list[Point]:
    """Return the controllers of the robots: the engine of the kind `POINT`."""
    assert len(programs) == len(robots)
    return [Point(robot) for robot in robots]


POINT = RobotKind("point", "robots", RADIUS, 0.01, HEIGHT, lambda setting: Drive(0.1, 0.1, 0.5, axle_cm=1.0),
                  lambda setting, drawn: Traits(), f"{__name__}:controllers")  # fmt: skip


@pytest.fixture
def mixed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a scene with two points and an e-puck."""
    monkeypatch.setitem(KINDS, "point", POINT)
    path = tmp_path / "mixed.toml"
    path.write_text(SCENE)
    return path


def test_a_trial_mixes_kinds(mixed: Path, tmp_path: Path) -> None:
    """Each kind has its own engine and drive; the e-puck searches while the points drive straight ahead."""
    arguments = ["--brain", "scripted", "--trials", "1", "--minutes", "0.1", "--jobs", "1"]
    assert main(["run", str(mixed), *arguments, "--out", str(tmp_path / "out")]) == 0
    columns = read_trial(tmp_path / "out/trial-0001.parquet").columns
    assert columns["r0_x"][-1] - columns["r0_x"][0] == pytest.approx(2.0 * 6, rel=0.02)
    assert columns["r1_y"][-1] - columns["r1_y"][0] == pytest.approx(4.0 * 6, rel=0.02)
    assert set(columns["r0_leds"][1:]) == {7}
    assert set(columns["r2_leds"]) == {0}
    assert abs(columns["r2_x"][-1] - 200) + abs(columns["r2_y"][-1] - 200) > 0.5


def test_bodies_have_the_size_of_their_kind(mixed: Path) -> None:
    """Contacts, cameras and infrared sensors take the radius of the kind."""
    scene = load_scene(str(mixed))
    world = World.of(scene, 1, [(100, 100, 0), (100 + 2 * RADIUS + 0.1, 100, 0), (200, 200, 0)], [])
    for _ in range(300):
        world.step([(2.0, 2.0), (0.0, 0.0), (0.0, 0.0)])
    (x, _, _), (other, _, _), _ = world.poses.robots
    assert other - x == pytest.approx(2 * RADIUS, abs=0.05)
    poses = Poses([(220, 200, 0), (100, 50, 0), (200, 200, 0)], [])
    eye = Renderer(scene, 2)
    eye.set_viewpoint(poses)
    seen = eye.classify_row(240, np.arange(640)) == ROBOT
    assert seen.sum() == pytest.approx(2 * 602 * RADIUS / (20 - 3.3), rel=0.05)
    beside = Poses([(200, 200 - 3.7 - 2.0 - RADIUS, 0), (100, 50, 0), (200, 200, 0)], [])
    gaps = [one.millimetres for one in Optics(scene).surfaces(beside, 2)]
    assert min(gaps) == pytest.approx(20), "the sensor at the right faces the point"


def test_an_unknown_kind_is_refused(mixed: Path) -> None:
    mixed.write_text(SCENE.replace('"point"', '"robot"'))
    with pytest.raises(SceneError, match=r"mixed.toml:7: robots.kind is 'robot'; expected epuck, "):
        load_scene(str(mixed))
