"""A world without walls (`arena.walls = false`): robots leave the rectangle, and see sky above the horizon."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from arena.campaign.bundle import pack, verify
from arena.cli import main
from arena.infrared.propagation import Optics
from arena.replay.page import trial_data
from arena.scene.loader import load_scene
from arena.trial.record import read_trial
from arena.world.physics import World

STRAIGHT = """class Controller:
    def __init__(self, robot, rng):
        pass

    def step(self, senses):
        return 12.0, 12.0
"""
OPEN = ("--set", "arena.walls=false", "--set", "arena.width_cm=60", "--set", "arena.height_cm=60")
ONE = ("--robots", "1", "--objects", "0", "--set", "marks.columns=1", "--set", "marks.rows=1")


def test_a_robot_leaves_the_rectangle(tmp_path: Path) -> None:
    """A robot that drives straight ahead for 12 s is at least 60 cm outside the rectangle. The record states that there
    are no walls, its bundle verifies, and a further trial begins where it ended."""
    (tmp_path / "straight.py").write_text(STRAIGHT)
    words = ["--controller", str(tmp_path / "straight.py"), "--minutes", "0.2", "--trials", "1", "--jobs", "1"]
    first = tmp_path / "first"
    assert main(["run", "clustering", *OPEN, *ONE, *words, "--out", str(first)]) == 0
    trial = read_trial(first / "trial-0001.parquet")
    x, y = trial.robots[-1, 0]
    assert max(-x, -y, x - 60, y - 60) > 60
    assert trial_data(trial)["walls"] is False
    pack([first], tmp_path / "x.zip")
    assert [check.equal for check in verify(tmp_path / "x.zip", lambda numbers: numbers, trust=True)] == [True]
    again = ["--start", str(first / "trial-0001.parquet"), "--out", str(tmp_path / "second")]
    assert main(["run", "clustering", *OPEN, *ONE, *words, *again]) == 0
    assert read_trial(tmp_path / "second" / "trial-0001.parquet").robots[0, 0] == pytest.approx((x, y))


def test_infrared_sensors_face_no_wall() -> None:
    """A robot 4 cm from the edge of the rectangle has a wall near four sensors, and without walls near none."""
    scene = load_scene("clustering").with_values(robots__count=1, objects__count=0)
    near = []
    for walls in (True, False):
        one = scene.with_values(arena__walls=walls, start__robot_poses=[[4.0, 150.0, 0.0]])
        near.append(sum(surface.share > 0 for surface in Optics(one).surfaces(World(one, 1).poses, 0)))
    assert near == [2, 0]


def test_walls_beside_a_polygon_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A room with a polygon has its outline as walls; `arena.walls = false` is refused. `arena keys` lists it."""
    scene = tmp_path / "room.toml"
    scene.write_text('name = "room"\n[arena]\nwalls = false\npolygon = [[0, 0], [200, 0], [100, 200]]\n')
    assert main(["run", str(scene), "--brain", "scripted"]) == 2
    assert "room.toml:3: arena.walls = false has no effect beside `polygon`" in capsys.readouterr().err
    assert main(["keys", "arena", "--json"]) == 0
    keys = {one["key"]: one for one in json.loads(capsys.readouterr().out)}
    assert keys["walls"]["default"] is True
