"""Swarms that compute together (docs/swarm.md): what their experiments measure, and that each agrees."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from arena.brain import switched_on
from arena.cli import main
from arena.experiments import Moments, Said, experiment_of
from arena.experiments._spoken import alive, apart, last_said, settled_at
from arena.metrics import Course
from arena.record import Trial, read_trial
from arena.scene import FCY, load_scene

NAN = math.nan


def moments(scene: str, seconds: list[float], said: list[Said]) -> Moments:
    """Of a trial in which robots stood about and said something."""
    places = np.zeros((len(seconds), load_scene(scene).robots.count, 3))
    return Moments(np.array(seconds), places, places[:, :0, :2], load_scene(scene), {}, said)


def test_what_robots_said_last_is_known_at_every_sample() -> None:
    """From the sample on that follows; other words and lines that are no number are passed over."""
    said = [Said(1, 0.2, "clock 7"), Said(1, 0.9, "clock x"), Said(1, 1.4, "clock 9"), Said(0, 1.5, "leader 9")]
    numbers, seconds = last_said(moments("clocks", [0.0, 1.0, 2.0], said), "clock")
    assert np.array_equal(numbers[:, 1], [NAN, 7, 9], equal_nan=True)
    assert np.array_equal(seconds[:, 1], [NAN, 0.2, 1.4], equal_nan=True)
    assert np.isnan(numbers[:, 0]).all()


def test_the_dead_do_not_count() -> None:
    """start.off of the scene; a robot alive that has said nothing leaves the difference open."""
    living = alive(moments("clocks", [0.0, 3.0, 3.25, 3.75], []))
    assert living.sum(axis=1).tolist() == [6, 6, 5, 4]
    values = np.array([[1.0, 4.0, 100.0], [1.0, 4.0, NAN]])
    assert apart(values, np.array([[True, True, False]] * 2)).tolist() == [3.0, 3.0]
    assert np.isnan(apart(values, np.full((2, 3), True))[1])


def test_agreement_counts_from_when_it_lasts() -> None:
    """A sample that breaks it begins anew; what does not hold at the end is nan."""
    course = Course(np.array([0.0, 1.0, 2.0, 3.0]), {})
    assert settled_at(course, np.array([True, False, True, True])) == 2.0
    assert settled_at(course, np.full(4, True)) == 0.0
    assert math.isnan(settled_at(course, np.array([True, True, True, False])))


def test_clocks_are_compared_with_the_arenas_time() -> None:
    """Two agree to 10 ms at 2 s, when all the others are dead, and are 5 ms later against true time at 4 s."""
    said = [Said(robot, 1.0, f"clock {1500 + robot}") for robot in range(4)] + [Said(4, 1.0, "clock 1600")]
    said += [Said(5, 1.0, "clock 1500"), Said(4, 3.2, "clock 3700")]
    said += [Said(robot, 3.6, "clock 4105") for robot in (2, 3, 4, 5)]
    course = experiment_of("clocks").course(moments("clocks", [0.0, 2.0, 3.3, 4.0], said))
    assert course.curves["apart"][1] == pytest.approx(100)
    assert course.curves["apart"][2:] == pytest.approx([3, 0])
    assert course.curves["drift"][2:] == pytest.approx([0, 4], abs=0.7)


def trial(tmp_path: Path, scene: str, seconds: float, *words: str) -> Trial:
    """A short one without deaths, of few robots that stand near each other."""
    text = (Path(__file__).parents[2] / "arena" / "scenes" / f"{scene}.toml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("off =")]
    path = tmp_path / f"{scene}.toml"
    few = "\n".join(lines).replace("count = 6", "count = 3").replace("count = 4", "count = 1")
    path.write_text(few.replace("= 40.0", "= 26.0"))
    command = ["run", str(path), "--trials", "1", "--minutes", f"{seconds / 60}", "--jobs", "1", *words]
    assert main([*command, "--out", str(tmp_path / "out")]) == 0
    return read_trial(tmp_path / "out" / "trial-0001.parquet")


def test_three_clocks_come_together(tmp_path: Path) -> None:
    """0.12 s apart when they begin, they agree to a part of it; a third of all messages is lost."""
    made = trial(tmp_path, "clocks", 2.5, "--set", "start.spread_tcy=4423680")
    begun = [switched_on(made.scene, 1, robot) / FCY for robot in range(3)]
    assert max(begun) - min(begun) > 0.1
    assert made.course.last("apart") < 50


def test_a_leader_is_one_who_lives() -> None:
    """Who follows the dead, or a rank that nobody has, does not count; a rank drawn anew replaces the one before."""
    said = [Said(robot, 0.2, f"rank {10 - robot}") for robot in range(6)]
    said += [Said(robot, 0.4, "leader 10") for robot in range(6)]
    said += [Said(5, 4.5, "rank 20"), Said(5, 4.5, "leader 20"), Said(4, 4.6, "leader 77"), Said(3, 4.6, "leader 20")]
    course = experiment_of("leader").course(moments("leader", [0.0, 1.0, 4.3, 5.0], said))
    assert course.curves["following"].tolist() == [0.0, 1.0, 0.0, 2 / 5]
    assert course.curves["leaders"].tolist() == [0, 1, 0, 1]


def test_three_robots_elect_one(tmp_path: Path) -> None:
    """The one whose selector says so."""
    made = trial(tmp_path, "leader", 2.0, "--set", "start.spread_tcy=1474560")
    assert made.course.last("following") == 1.0
    assert made.moments.said[-1].text.startswith("leader 4")
