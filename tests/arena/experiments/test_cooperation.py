"""Cooperating swarms (docs/swarm.md): metrics of their experiments, and agreement of the robots."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from arena.cli import main
from arena.experiments import TrialSamples, UartLine, experiment_of
from arena.experiments.uart_values import alive, apart, last_values, settled_at
from arena.metrics import MetricSeries
from arena.robots.controller import power_on_cycle
from arena.scene.loader import FCY, load_scene
from arena.trial.record import Trial, read_trial

NAN = math.nan


def samples(scene: str, seconds: list[float], lines: list[UartLine]) -> TrialSamples:
    """Return the samples of a trial in which robots do not move and send `lines`."""
    places = np.zeros((len(seconds), load_scene(scene).robots.count, 3))
    return TrialSamples(np.array(seconds), places, places[:, :0, :2], load_scene(scene), {}, lines)


def test_the_last_value_is_known_at_every_sample() -> None:
    """A reported value holds from the next sample on; other keywords, and lines without a number, are ignored."""
    lines = [
        UartLine(1, 0.2, "clock 7"),
        UartLine(1, 0.9, "clock x"),
        UartLine(1, 1.4, "clock 9"),
        UartLine(0, 1.5, "leader 9"),
    ]
    numbers, seconds = last_values(samples("clocks", [0.0, 1.0, 2.0], lines), "clock")
    assert np.array_equal(numbers[:, 1], [NAN, 7, 9], equal_nan=True)
    assert np.array_equal(seconds[:, 1], [NAN, 0.2, 1.4], equal_nan=True)
    assert np.isnan(numbers[:, 0]).all()


def test_the_dead_do_not_count() -> None:
    """Robots that are switched off are ignored; the range is nan until every other robot has reported."""
    living = alive(samples("clocks", [0.0, 2.5, 2.75, 3.25], []))
    assert living.sum(axis=1).tolist() == [5, 5, 4, 3]
    values = np.array([[1.0, 4.0, 100.0], [1.0, 4.0, NAN]])
    assert apart(values, np.array([[True, True, False]] * 2)).tolist() == [3.0, 3.0]
    assert np.isnan(apart(values, np.full((2, 3), True))[1])


def test_agreement_counts_from_when_it_lasts() -> None:
    """The time of agreement is that of the last change to true; it is nan if the condition is false at the end."""
    series = MetricSeries(np.array([0.0, 1.0, 2.0, 3.0]), {})
    assert settled_at(series, np.array([True, False, True, True])) == 2.0
    assert settled_at(series, np.full(4, True)) == 0.0
    assert math.isnan(settled_at(series, np.array([True, True, True, False])))


def test_clocks_are_compared_with_the_arenas_time() -> None:
    """Three robots whose clocks agree from 3.3 s on are 5 ms behind simulated time at 4 s."""
    lines = [UartLine(robot, 1.0, f"clock {1500 + robot}") for robot in range(3)] + [UartLine(3, 1.0, "clock 1600")]
    lines += [UartLine(4, 1.0, "clock 1500"), UartLine(3, 3.2, "clock 3700")]
    lines += [UartLine(robot, 3.6, "clock 4105") for robot in (2, 3, 4)]
    series = experiment_of("clocks").series(samples("clocks", [0.0, 2.0, 3.3, 4.0], lines))
    assert series.curves["apart"][1] == pytest.approx(100)
    assert series.curves["apart"][2:] == pytest.approx([2, 0])
    assert series.curves["drift"][2:] == pytest.approx([0, 4], abs=0.7)


def trial(tmp_path: Path, scene: str, seconds: float, *words: str, fewer: int = 2) -> Trial:
    """Run a short trial of a scene with `fewer` robots less, closer to each other, none of them switched off."""
    text = (Path(__file__).parents[3] / "arena" / "scenes" / f"{scene}.toml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("off =")]
    path = tmp_path / f"{scene}.toml"
    few = re.sub(r"count = (\d)", lambda found: f"count = {int(found[1]) - fewer}", "\n".join(lines))
    path.write_text(few.replace("= 32.0", "= 24.0"))
    command = ["run", str(path), "--trials", "1", "--minutes", f"{seconds / 60}", "--jobs", "1", *words]
    assert main([*command, "--out", str(tmp_path / "out")]) == 0
    return read_trial(tmp_path / "out" / "trial-0001.parquet")


@pytest.mark.slow
def test_three_clocks_come_together(tmp_path: Path) -> None:
    """Three clocks that differ by 0.12 s approach each other although a third of all messages is lost."""
    made = trial(tmp_path, "clocks", 3.0, "--set", "start.spread_tcy=4423680")
    begun = [power_on_cycle(made.scene, 1, robot) / FCY for robot in range(3)]
    assert max(begun) - min(begun) > 0.1
    assert made.series.last("apart") < 50


def test_only_a_robot_that_is_on_and_ranked_is_a_leader() -> None:
    """Followers of a robot that is switched off or has an unknown rank do not count; the last reported rank is used."""
    lines = [UartLine(robot, 0.2, f"rank {10 - robot}") for robot in range(5)]
    lines += [UartLine(robot, 0.4, "leader 10") for robot in range(5)]
    lines += [
        UartLine(4, 4.5, "rank 20"),
        UartLine(4, 4.5, "leader 20"),
        UartLine(3, 4.6, "leader 77"),
        UartLine(2, 4.6, "leader 20"),
    ]
    series = experiment_of("leader").series(samples("leader", [0.0, 1.0, 2.8, 5.0], lines))
    assert series.curves["following"].tolist() == [0.0, 1.0, 0.0, 2 / 4]
    assert series.curves["leaders"].tolist() == [0, 1, 0, 1]


@pytest.mark.slow
def test_three_robots_elect_one(tmp_path: Path) -> None:
    """Three robots elect the robot whose selector makes it the leader."""
    made = trial(tmp_path, "leader", 2.0, "--set", "start.spread_tcy=1474560")
    assert made.series.last("following") == 1.0
    word, rank = made.samples.uart_lines[-1].text.split()
    assert word == "leader"
    assert int(rank) >> 11 == 2


def test_who_has_stopped_says_so_and_stands() -> None:
    """Robots that are switched off are ignored; the difference of the stopping times is known once all others have
    stopped."""
    lines = [UartLine(robot, 3.0 + robot / 100, f"halt {robot}") for robot in (2, 3)] + [UartLine(4, 3.35, "halt 4")]
    seen = samples("halt", [0.0, 2.9, 3.1, 3.2, 3.3, 3.5], lines)
    seen.robots[:, 3, 0] = [0.0, 3.0, 4.0, 4.0, 4.0, 4.0]
    series = experiment_of("halt").series(seen)
    assert series.curves["standing"].tolist() == pytest.approx([0, 0, 1 / 4, 2 / 4, 2 / 3, 1])
    assert np.isnan(series.curves["between"][:-1]).all()
    assert series.last("between") == pytest.approx(0.33)


@pytest.mark.slow
def test_two_robots_stop_together(tmp_path: Path) -> None:
    """One robot knows the stopping time; the other stops at it because it receives the messages (docs/swarm.md)."""
    assert trial(tmp_path, "halt", 4.5, fewer=3).series.last("between") < 0.1


def test_a_mean_is_that_of_those_who_live() -> None:
    """Reported means, in hundredths, are compared with the mean of the robots that are on; the error is nan until all
    have reported."""
    lines = [UartLine(robot, 0.5, f"value {robot}") for robot in range(5)]
    lines += [UartLine(robot, 0.6, "mean 200") for robot in range(4)] + [UartLine(4, 1.6, "mean 250")]
    lines += [UartLine(robot, 3.2, "mean 300") for robot in (2, 3)]
    series = experiment_of("average").series(samples("average", [0.0, 1.0, 2.0, 3.5], lines))
    assert np.isnan(series.curves["error"][:2]).all()
    assert series.curves["error"][2:] == pytest.approx([0.5, 0.5])
    assert series.curves["typical"][2:] == pytest.approx([0.1, 0.5 / 3])


@pytest.mark.slow
def test_robots_agree_on_a_mean(tmp_path: Path) -> None:
    """Robots with the values 15, 9 and 2 agree on their mean."""
    made = trial(tmp_path, "average", 1.5, "--set", "infrared.lost_share=0")
    assert any(one.text == "mean 867" for one in made.samples.uart_lines)


def test_who_knows_the_answer_knows_that_all_is_done() -> None:
    """A search is complete when a robot reports the right answer; wrong answers, answers before all parts are done, and
    robots that are off do not count."""
    lines = [UartLine(robot, 0.5, "done 8") for robot in range(5)] + [
        UartLine(0, 1.1, "best 52527"),
        UartLine(0, 1.1, "done 32"),
        UartLine(1, 1.1, "best 52527"),
    ]
    lines += [UartLine(2, 2.6, f"best {best}") for best in (9, 52527)] + [
        UartLine(2, 2.6, "done 32"),
        UartLine(3, 2.6, "done 32"),
    ]
    series = experiment_of("search").series(samples("search", [0.0, 1.0, 1.25, 3.0], lines))
    assert series.curves["done"] == pytest.approx([0, 0.25, (4 * 0.25 + 1) / 5, (0.25 + 1 + 1) / 3])
    assert series.curves["right"] == pytest.approx([0, 0, 1 / 5, 1 / 3])


@pytest.mark.slow
def test_robots_share_a_search(tmp_path: Path) -> None:
    """A robot learns several parts of the search at once from its neighbours."""
    made = trial(tmp_path, "search", 1.5, "--set", "infrared.lost_share=0", fewer=3)
    lines = made.samples.uart_lines
    done = [
        [int(one.text.split()[1]) for one in lines if (one.robot, one.text[:4]) == (robot, "done")]
        for robot in range(2)
    ]
    assert max(after - before for counts in done for before, after in pairwise(counts)) >= 2
