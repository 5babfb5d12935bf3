"""Experiments with Kilobots: their metrics on constructed samples, and the firmware of each for some seconds."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from arena.cli import main
from arena.experiments import LedEvent, TrialSamples, experiment_of
from arena.experiments.builtin.gradient import true_hops
from arena.scene.loader import load_scene
from arena.trial.record import Trial, read_trial
from tests.emu.avr.conftest import needs


def ran(scene: str, seconds: float, out: Path, *settings: str) -> Trial:
    """Run an included scene for some seconds."""
    needs("avr-gcc")
    arguments = ["--trials", "1", "--minutes", str(seconds / 60), "--jobs", "1", "--out", str(out)]
    assert main(["run", scene, *arguments, *(word for one in settings for word in ("--set", one))]) == 0
    return read_trial(out / "trial-0001.parquet")


def samples(scene: str, robots: list[list[tuple[float, float]]], *changes: LedEvent) -> TrialSamples:
    """Return samples every second: positions of the robots in cm, all with heading 0."""
    poses = np.array([[(x, y, 0.0) for x, y in sample] for sample in robots])
    times = np.arange(len(robots), dtype=float)
    return TrialSamples(times, poses, np.zeros((len(robots), 0, 2)), load_scene(scene), {}, (), changes)


def test_hops_count_the_shortest_path() -> None:
    """Robots within reach are neighbours; without a path there is no hop count, and the LED must be dark."""
    places = [(0.0, 0.0), (5.0, 0.0), (5.0, 5.0), (9.0, 0.0), (30.0, 0.0)]
    assert true_hops(np.array(places), 5.0).tolist() == [0, 1, 2, 2, -1]
    shown = [LedEvent(robot, 0.5, leds) for robot, leds in enumerate((1, 5, 4, 5, 0))]
    curves = experiment_of("gradient").all_curves(samples("gradient", [places] * 3, *shown, LedEvent(3, 1.5, 4)))
    assert curves["correct"].tolist() == [0.2, 0.8, 1.0]
    assert curves["hops"].tolist() == [2.0] * 3
    none = replace(samples("gradient", [places]), robots=np.zeros((1, 0, 3)))
    assert experiment_of("gradient").all_curves(none)["correct"].tolist() == [1.0]


def test_the_spread_of_blinks_is_a_circular_arc() -> None:
    """Blinks around the end of a period are close to each other; the spread is nan until every robot has blinked."""
    tick = 0.032768
    blinks = [LedEvent(0, 1.0, 21), LedEvent(0, 1.1, 0), LedEvent(1, 1.0 + 48 * tick, 21)]
    made = samples("blinking", [[(0.0, 0.0), (4.0, 0.0)]] * 4, *blinks)
    curves = experiment_of("blinking").all_curves(made)
    assert np.isnan(curves["spread"][:2]).all()
    assert curves["spread"][3] == pytest.approx(2.0)
    assert curves["blinks"][3] == 1.0


def test_rounds_and_distances_of_movers() -> None:
    """A quarter of a circle is a quarter of a round; distances are those of the nearest robot."""
    circle = [(10 * math.cos(a), 10 * math.sin(a)) for a in np.linspace(0, math.pi / 2, 31)]
    orbit = experiment_of("orbit").all_curves(samples("orbit", [[(0.0, 0.0), at] for at in circle]))
    assert orbit["rounds"][-1] == pytest.approx(0.25)
    assert orbit["distance"] == pytest.approx(np.full(31, 10.0))
    distance = experiment_of("orbit").curves[0]
    assert distance.reference is not None
    assert distance.shown(distance.reference[0]).startswith("60"), distance.reference[1]
    edge = experiment_of("edge").all_curves(samples("edge", [[(-2.0, 0.0), (2.0, 0.0), at] for at in circle]))
    assert edge["distance"][0] == pytest.approx(8.0)
    assert edge["rounds"][-1] == pytest.approx(0.25)


def test_a_gradient_forms(tmp_path: Path) -> None:
    """Nineteen robots show their hop counts some seconds after RUN."""
    trial = ran("gradient", 4.0, tmp_path / "out", "robots.count=19")
    assert trial.series.curves["correct"].max() == 1.0
    assert trial.series.last("hops") == 2.0


@pytest.mark.slow
def test_a_planet_orbits_and_a_robot_follows_an_edge(tmp_path: Path) -> None:
    """The planet stays at 60 mm within 10 mm, the edge follower at 50 mm within 12 mm; both go half a round."""
    orbit = ran("orbit", 40.0, tmp_path / "orbit").series
    late = 10 * orbit.curves["distance"][orbit.times > 20]
    assert np.abs(late - 60).max() < 10
    assert orbit.last("rounds") > 0.5
    edge = ran("edge", 40.0, tmp_path / "edge").series
    assert np.abs(10 * edge.curves["distance"][edge.times > 15] - 50).max() < 12
    assert edge.last("rounds") > 0.5


@pytest.mark.slow
def test_robots_blink_together(tmp_path: Path) -> None:
    """Seven robots of different phases blink together after 40 s."""
    series = ran("blinking", 40.0, tmp_path / "out", "robots.count=7").series
    assert np.nanmax(series.curves["spread"]) > 20
    assert series.last("spread") < 10
