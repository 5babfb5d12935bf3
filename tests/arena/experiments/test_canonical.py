"""The reproduced experiments of docs/canonical.md: aggregation without computation, occlusion-based transport."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import canonical
import numpy as np
import pytest

from arena.cli import main
from arena.experiments import TrialSamples, experiment_of
from arena.experiments.builtin.transport import MEASURES
from arena.robots.reactive import steps_per_second
from arena.scene.loader import SceneError, load_scene
from arena.trial.record import Trial, read_trial
from emu.cli import main as emu
from tests.firmware.conftest import built_once

PAGE = (Path(__file__).resolve().parents[3] / "docs/canonical.md").read_text(encoding="utf-8")


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


def row(run: str) -> list[str]:
    """Return the cells of a run's row on the page, without its name."""
    found = re.search(rf"^\| {run} \| (.*) \|$", PAGE, re.MULTILINE)
    assert found is not None, run
    return found[1].split(" | ")


@pytest.mark.slow
@pytest.mark.parametrize(("robots", "seconds"), [(10, 600), (20, 180)])
def test_scripted_robots_form_one_group_when_the_page_says_so(tmp_path: Path, robots: int, seconds: int) -> None:
    """Where the page prints a mean of 100.0 %, all trials have one group; so does the trial of seed 1."""
    assert row(f"scripted-{robots}")[1 + (180, 600, 900).index(seconds)] == "100.0 %"
    options = "--controller", "aggregate", "--robots", str(robots)
    trial = trial_of("gauci2014", str(seconds / 60), tmp_path / "out", *options)
    assert trial.series.last("cluster") == 1


@pytest.mark.slow
def test_forty_robots_form_one_group(tmp_path: Path) -> None:
    """Forty scripted robots are in one group after ten minutes (published: 98.6 % of the robots)."""
    trial = trial_of("gauci2014", "10", tmp_path / "out", "--controller", "aggregate")
    assert trial.series.last("cluster") > 0.95


def test_the_intervals_of_transport_follow_from_the_arrivals() -> None:
    """Every interval beside `N of M` on the page is that of Clopper and Pearson, and the sums are those of the rows."""
    rows = re.findall(r"^\| ([\w-]+) \| (\d+) of (\d+) \| (\d+ to \d+ %) \|", PAGE, re.MULTILINE)
    assert len(rows) == 6
    arrivals = {name: int(count) for name, count, _, _ in rows}
    assert [one[3] for one in rows] == [canonical.interval(int(count), int(trials)) for _, count, trials, _ in rows]
    text = " ".join(PAGE.split())
    of_one_area = sum(arrivals[name] for name in ("square-40", "triangle-60", "disc-45"))
    assert f"in 43 of 45 trials (abstract), 95 % interval {canonical.interval(43, 45)}. Here {of_one_area} of" in text
    assert f"of the 45 trials with the three shapes of one area succeed, {canonical.interval(of_one_area, 45)}" in text
    failures = sum(int(trials) - int(count) for name, count, trials, _ in rows if name != "openswarm-10")
    assert f"In all {failures} failures of the table" in text


def test_the_size_of_the_transport_program_is_the_counted_one(
    tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    """`emu footprint` counts the bytes of the page."""
    assert emu(["footprint", str(built_once(tmp_path_factory, "transport")), "--json"]) == 0
    total = json.loads(capsys.readouterr().out)
    assert f"The program uses {total['rom']:,} bytes of ROM and {total['ram']:,} of the 8,192 bytes of RAM" in PAGE


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
