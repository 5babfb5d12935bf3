"""The reproduced experiments of docs/canonical.md: aggregation without computation, occlusion-based transport."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from arena.cli import main
from arena.experiments import TrialSamples, experiment_of
from arena.experiments.builtin.transport import MEASURES
from arena.robots.reactive import steps_per_second
from arena.scene.loader import SceneError, load_scene
from arena.trial.record import Trial, read_trial


def trial_of(scene: str, minutes: str, out: Path, *more: str) -> Trial:
    """Return the trial of seed 1 of a scripted run."""
    assert main(["run", scene, "--brain", "scripted", "--trials", "1", "--jobs", "1", "--minutes", minutes, "--out",
                 str(out), *more]) == 0  # fmt: skip
    return read_trial(out / "trial-0001.parquet")


def test_the_table_of_aggregation_drives_the_published_circle() -> None:
    """epuck.md §8: backwards on a circle of 14.45 cm without a robot in sight, on the spot with one; speeds are whole
    mm/s of 129."""
    left, right = steps_per_second("aggregate", 0)
    assert 5.1 / 2 * (left + right) / (right - left) == pytest.approx(14.45, rel=0.02)
    assert (left < 0, right) == (True, -1000)
    assert steps_per_second("aggregate", 2) == (1000, -1000)


def test_robots_gather(tmp_path: Path) -> None:
    """Ten scripted robots are less dispersed after a minute than at the start."""
    trial = trial_of("gauci2014", "1", tmp_path / "out", "--controller", "aggregate", "--robots", "10")
    dispersion = trial.series.curves["dispersion"]
    assert dispersion[-1] < 0.6 * dispersion[0]


@pytest.mark.slow
def test_forty_robots_form_one_group(tmp_path: Path) -> None:
    """Forty scripted robots are in one group after ten minutes (published: 98.6 % of the robots)."""
    trial = trial_of("gauci2014", "10", tmp_path / "out", "--controller", "aggregate")
    assert trial.series.last("cluster") > 0.95


def test_transport_is_measured_from_circle_to_circle() -> None:
    """Distance is the gap between the goal and the circle around the object; arrival, path and efficiency follow."""
    scene = load_scene("chen2015")
    radius = 20 * math.sqrt(2)
    places = np.array([[[120.0, 112.5]], [[120.0, 112.5]], [[120.0, 142.5]], [[350.0 - 10 - radius, 112.5]]])
    samples = TrialSamples(np.arange(4.0), np.zeros((4, 20, 3)), places, scene, {})
    series = experiment_of("transport").series(samples)
    assert series.curves["distance"][[0, 3]] == pytest.approx([230 - 10 - radius, 0.0])
    last = math.hypot(220 - radius, 30)
    assert series.curves["path"] == pytest.approx([0, 0, 30, 30 + last])
    arrival, efficiency, _ = (one.of(series, 10.0) for one in MEASURES)
    assert arrival == 3.0
    assert efficiency == pytest.approx((220 - radius) / (30 + last))
    assert math.isnan(MEASURES[0].of(series, 2.5))


def test_transport_needs_a_goal() -> None:
    """A scene without an obstacle called goal is refused."""
    samples = TrialSamples(np.zeros(1), np.zeros((1, 5, 3)), np.zeros((1, 20, 2)), load_scene("clustering"), {})
    with pytest.raises(SceneError, match="needs an object and a round obstacle with the name goal"):
        experiment_of("transport").series(samples)


@pytest.mark.slow
def test_a_swarm_transports_the_box(tmp_path: Path) -> None:
    """Twenty scripted robots push the box to the goal that it hides, and the trial ends with the arrival."""
    trial = trial_of("chen2015", "15", tmp_path / "out")
    assert trial.series.last("distance") == 0
    assert trial.times[-1] < 890
    assert len({robot for robot in range(20) if (np.array(trial.columns[f"r{robot}_seen"]) == 2).any()}) > 5


ONE_ROBOT = """
name = "one"
experiment = "transport"

[arena]
width_cm = 200.0
height_cm = 100.0

[chassis]
colour = "white"

[[robots]]
name = "robot"
image = "transport"
place = "poses"
poses = [[{}, 50, {}]]

[[objects]]
radius_cm = 15
height_cm = 20
place = "poses"
poses = [[90, 50]]
mass_kg = 0.1
colour = "red"

[[obstacles]]
name = "goal"
x_cm = 180
y_cm = 50
radius_cm = 10
height_cm = 40
colour = "green"

[camera]
range_cm = "inf"
pitch_deg = 8.0
"""
BODY_LED, FRONT_LED = 512, 256
"""Bits of `Reading.leds`: the application lights the body LED while it pushes, the front LED while it moves on."""


@pytest.mark.slow
@pytest.mark.parametrize(("x", "heading", "led"), [(60, 0, BODY_LED), (120, 180, FRONT_LED)])
def test_firmware_pushes_only_where_the_object_hides_the_goal(tmp_path: Path, x: int, heading: int, led: int) -> None:
    """Behind the object a robot pushes it towards the goal; between object and goal it moves on and does not push."""
    scene = tmp_path / "one.toml"
    scene.write_text(ONE_ROBOT.format(x, heading), "utf-8")
    options = ["--trials", "1", "--jobs", "1", "--minutes", "0.13", "--out", str(tmp_path / "out")]
    assert main(["run", str(scene), *options]) == 0
    trial = read_trial(tmp_path / "out/trial-0001.parquet")
    assert set(trial.columns["r0_leds"]) == {0, led}
    assert (trial.objects[-1, 0, 0] > 91) == (led == BODY_LED)
