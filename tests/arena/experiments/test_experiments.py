"""Experiments: built-in and user-defined ones, supervisors, and error messages."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from arena.cli import main
from arena.experiments import TrialSamples, experiment_of
from arena.experiments.builtin.foraging import init, step
from arena.experiments.supervisor import Supervisor
from arena.robots.controller import ScriptedController
from arena.scene.loader import Scene, SceneError, load_scene, scripted
from arena.trial.record import read_trial
from arena.trial.trial import run_trial
from arena.world.physics import World
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[3]
SCENE = """name = "mine"
experiment = "mine.py"
[arena]
width_cm = 100
height_cm = 100
[[robots]]
count = 2
place = "poses"
poses = [[30, 50, 0], [60, 50, 180]]
[[objects]]
place = "poses"
poses = [[50, 80]]
"""
METRIC = """from arena.experiments import Curve

CURVES = [Curve("apart", "distance of the two robots", "cm")]


def metrics(sample):
    (x, y, _), (ox, oy, _) = sample.robots
    return {"apart": ((x - ox) ** 2 + (y - oy) ** 2) ** 0.5}
"""
SUPERVISOR = (
    METRIC
    + """

def init(stage):
    stage.memory["moved"] = 0
    stage.note("moved", 0)


def step(stage):
    if stage.seconds > 1 and not stage.memory["moved"]:
        stage.memory["moved"] = 1
        stage.note("moved", 1)
        stage.move_object(0, *stage.rng.uniform(70, 90, 2))
        stage.move_robot(1, 80, 20, 1.5)


def done(stage):
    return stage.seconds > 2
"""
)


def run(folder: Path, *words: str, scene: str = SCENE, metric: str = METRIC, status: int = 0) -> Path:
    """Write a scene and an experiment into a folder and run one scripted trial."""
    (folder / "mine.toml").write_text(scene)
    (folder / "mine.py").write_text(metric)
    command = ["run", str(folder / "mine.toml"), "--brain", "scripted", "--trials", "1", "--minutes", "0.05"]
    assert main([*command, "--jobs", "1", "--out", str(folder / "out"), *words]) == status
    return folder / "out" / "trial-0001.parquet"


FIRMWARE = """/* Two robots drive at each other until infrared says that they are near. */
#include <analog.h>
#include <openswarm.h>
#include <openswarm_io.h>

enum { CRUISE = 80, NEAR_MM = 40 };

static bool steer(uint16 pid, uint16 event, sys_event_data *data)
{
    const uint8 *mm = data->payload;
    bool near = mm[0] < NEAR_MM || mm[7] < NEAR_MM;
    (void)pid;
    (void)event;
    Sys_Set_LED(SYS_LED_FRONT, near);
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, near ? 0 : CRUISE);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, near ? 0 : CRUISE);
    return true;
}

int main(void)
{
    Sys_Init_Kernel();
    Sys_Start_Analog();
    Sys_Subscribe_to_Event(SYS_IO_PROXIMITY, 0, steer, NULL);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
"""


@pytest.mark.slow
def test_a_new_experiment_needs_a_scene_a_metric_and_some_c(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A user-defined experiment in an empty folder can be run, printed, drawn and replayed."""
    app = tmp_path / "apps" / "mine"
    app.mkdir(parents=True)
    (app / "main.c").write_text(FIRMWARE)
    (app / "app.mk").write_text("DEVICES := analog\n")
    made = ["make", "-C", str(ROOT / "firmware"), "APP=mine", f"APPS={app.parent}", f"OUT={tmp_path / 'build'}",
            f"PYTHON={sys.executable}"]  # fmt: skip
    done = subprocess.run(made, capture_output=True, text=True, timeout=HANG, check=False)
    assert done.returncode == 0, done.stderr
    path = run(tmp_path, "--brain", str(tmp_path / "build" / "firmware.elf"), "--set", "start.remote=")
    assert "distance of the two robots" in capsys.readouterr().out
    apart = read_trial(path).series.curves["apart"]
    assert apart[0] == pytest.approx(30)
    assert 7.3 < apart[-1] < 20
    assert main(["plot", str(path.parent), "--out", str(tmp_path / "figures")]) == 0
    assert {one.name for one in (tmp_path / "figures").iterdir()} >= {"curves.png", "snapshots.png"}
    assert main(["replay", str(path)]) == 0
    assert "distance of the two robots" in path.with_suffix(".html").read_text()


def test_the_experiments_file_is_kept_and_belongs_to_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A later change of the experiment's file does not affect a record; a run with the changed file is refused."""
    path = run(tmp_path)
    before = read_trial(path).series.curves["apart"]
    (tmp_path / "mine.py").write_text(METRIC.replace("** 0.5", "** 0.5 + 1000"))
    assert (read_trial(path).series.curves["apart"] == before).all()
    assert (path.parent / "experiment.py").read_text() == METRIC
    run(tmp_path, metric=METRIC + "\n", status=2)
    assert "different experiment_sha256" in capsys.readouterr().err


def test_a_supervisor_moves_things_notes_numbers_and_ends_the_trial(tmp_path: Path) -> None:
    """The supervisor's numbers are columns n_NAME of the record, and the record is reproducible."""
    path = run(tmp_path, metric=SUPERVISOR)
    trial = read_trial(path)
    assert trial.times[-1] == pytest.approx(2.1, abs=0.02)
    assert trial.columns["n_moved"].tolist() == [0, 0, 0, 1, 1, 1]
    assert trial.objects[2, 0].tolist() == [50, 80]
    assert (trial.objects[3, 0] > 69).all()
    assert trial.robots[3, 1] == pytest.approx((80, 20), abs=8)
    assert math.dist(trial.robots[2, 1], trial.robots[3, 1]) > 20
    path.rename(tmp_path / "first.parquet")
    assert run(tmp_path, metric=SUPERVISOR).read_bytes() == (tmp_path / "first.parquet").read_bytes()


@pytest.mark.parametrize(
    ("metric", "words"),
    [
        ("def metrics(:", "mine.py:1: SyntaxError"),
        ("x = 1\nimport nowhere", "mine.py:2: ModuleNotFoundError"),
        ("CURVES = []", "an experiment must define metrics(sample)"),
        ("def metrics(sample): return {}", "an experiment must define its metrics"),
        (METRIC.replace('"apart":', '"other":'), "metrics: KeyError: 'apart'"),
        (METRIC.replace("sample.robots", "sample.nothing"), "metrics: AttributeError"),
        (METRIC + "\ndef step(stage): stage.move_object(9, 1, 1)\n", "step: IndexError"),
        (METRIC + "\ndef step(stage): stage.move_object(0, -1, 1)\n", "(-1, 1) cm is outside the walls"),
        (METRIC + "\ndef step(stage): stage.note('late', 1)\n", "init must note every name first"),
        (METRIC + "\ndef init(stage): 1 / 0\n", "init: ZeroDivisionError: division by zero"),
        ("import sys\nsys.exit(3)\n", "mine.py:2: SystemExit: 3"),
        (METRIC + "\ndef step(stage): raise SystemExit(5)\n", "step: SystemExit: 5"),
    ],
)
def test_a_wrong_experiment_is_reported_in_one_line(
    metric: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An invalid experiment ends with status 2 and a message of one line."""
    run(tmp_path, metric=metric, status=2)
    said = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("trial ")]
    assert len(said) == 1
    assert words in said[0]


def test_experiments_that_are_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An unknown experiment name and a missing experiment file are refused."""
    run(tmp_path, scene=SCENE.replace("mine.py", "nothing"), status=2)
    assert "unknown experiment 'nothing'; known: aggregation, average, avoidance, blinking, " in capsys.readouterr().err
    run(tmp_path, scene=SCENE.replace("mine.py", "lost.py"), status=2)
    assert "lost.py" in capsys.readouterr().err


# -- built-in experiments --------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", ["aggregation", "avoidance", "foraging"])
def test_the_shipped_experiments_run_with_their_firmware(name: str, tmp_path: Path) -> None:
    """In two seconds of each built-in experiment no robot has a fault, robots move, metrics are finite, and curves
    are drawn."""
    out = tmp_path / name
    assert main(["run", name, "--trials", "1", "--minutes", "0.035", "--jobs", "2", "--out", str(out)]) == 0
    trial = read_trial(out / "trial-0001.parquet")
    assert np.abs(trial.robots[-1] - trial.robots[0]).max() > 2
    for values in trial.series.curves.values():
        assert np.isfinite(values).all()
    assert main(["plot", str(out), "--out", str(tmp_path)]) == 0
    assert (tmp_path / "curves.png").stat().st_size > 5000


class Listener:
    """Controller that stores the text it receives from the supervisor."""

    def __init__(self) -> None:
        self.heard: list[bytes] = []

    def feed_uart(self, data: bytes) -> None:
        self.heard.append(data)


def test_foraging_counts_food_that_came_from_outside_to_the_nest() -> None:
    """In the foraging experiment a robot receives one message per touch and per delivery, and food reappears at a
    free place."""
    scene = load_scene("foraging")
    food = [(150.0, 30.0 + 18 * n) for n in range(6)]
    world = World.of(scene, 1, [(100, 20, 0.0), (100, 60, 0.0), (100, 120, 0.0)], food)
    controllers = [Listener() for _ in range(3)]
    stage = Supervisor(world, controllers, 1)  # type: ignore[arg-type]
    init(stage)
    step(stage)
    assert stage.noted == {"delivered": 0, "carrying": 0}
    stage.move_robot(1, 150 - 7.0, 66)
    step(stage)
    assert controllers[1].heard == [b"food\n"]
    assert stage.noted["carrying"] == 1
    grown = stage.objects[2]
    assert math.dist(grown, (150, 66)) > 10
    assert math.dist(grown, (40, 75)) > 30
    stage.move_robot(1, 45, 75)
    step(stage)
    step(stage)
    assert controllers[1].heard == [b"food\n", b"nest\n"]
    assert stage.noted == {"delivered": 1, "carrying": 0}
    assert not controllers[0].heard
    assert not controllers[2].heard


TRIANGLE = """name = "triangle"
[arena]
polygon = [[0, 0], [100, 0], [0, 100]]
[[robots]]
place = "poses"
poses = [[20, 20, 0], [40, 20, 0]]
[[objects]]
place = "poses"
poses = [[60, 20]]
[[obstacles]]
name = "pillar"
x_cm = 20
y_cm = 60
radius_cm = 8
[[obstacles]]
name = "box"
polygon = [[5, 30], [15, 30], [15, 40], [5, 40]]
"""


@pytest.mark.parametrize(
    ("place", "why"),
    [
        ((90, 90), "is outside the walls"), ((-1, 5), "is outside the walls"),
        ((50, 48), "touches a wall or an obstacle"), ((2, 50), "is in a wall"),
        ((20, 60), "touches obstacle pillar"), ((10, 35), "is inside obstacle box"),
        ((40, 22), "touches what is at (40, 20) cm"), ((math.nan, 20), "is outside the walls"),
    ],
)  # fmt: skip
def test_a_supervisor_cannot_move_a_body_into_another_one(place: tuple[float, float], why: str, tmp_path: Path) -> None:
    """Walls of any shape, obstacles, robots and objects obstruct a move by the supervisor; the body then stays where
    it is."""
    (tmp_path / "triangle.toml").write_text(TRIANGLE)
    world = World(load_scene(str(tmp_path / "triangle.toml")), 1)
    stage = Supervisor(world, [], 1)
    before = world.poses.values.copy()
    for name, move in (("robot 0", stage.move_robot), ("object 0", stage.move_object)):
        with pytest.raises(SceneError, match=re.escape(f"{name} at ({place[0]:g}, {place[1]:g}) cm {why}")):
            move(0, *place)
    with pytest.raises(SceneError, match="heading nan"):
        stage.move_robot(0, 20, 20, math.nan)
    assert (world.poses.values == before).all()
    stage.move_robot(0, 25, 20)
    stage.move_robot(0, 25.5, 20)  # a robot does not obstruct itself
    stage.move_object(-1, 60, 21)
    assert [tuple(robot[:2]) for robot in world.poses.robots] == [(25.5, 20), (40, 20)]
    assert world.poses.objects == [(60, 21)]


def test_aggregation_measures_robots(tmp_path: Path) -> None:
    """The aggregation metrics count robots close together as one group with small dispersion, and distant robots as
    single."""
    experiment, scene = experiment_of("aggregation"), load_scene("aggregation")
    near = np.array([(20.0 * 0.37 * n, 0.0, 0.0) for n in range(8)])
    far = np.array([(30.0 * n, 0.0, 0.0) for n in range(8)])
    series = experiment.series(
        TrialSamples(np.array([0.0, 1.0]), np.stack([far, near]), np.zeros((2, 0, 2)), scene, {})
    )
    assert series.curves["cluster"].tolist() == [1 / 8, 1.0]
    assert series.curves["dispersion"][1] < series.curves["dispersion"][0] / 10


def test_a_trial_without_supervisor_is_the_one_it_was() -> None:
    """An experiment without a supervisor does not affect the trial."""
    scene: Scene = scripted(load_scene("clustering"))
    rows = []
    for experiment in (None, experiment_of("clustering")):
        controllers = [ScriptedController(scene, 1, robot, "A") for robot in range(5)]
        rows.append(run_trial(scene, 1, controllers, 3.0, experiment=experiment).rows.columns)
    assert rows[0] == rows[1]


def test_names_of_experiments_are_checked() -> None:
    """The name of another module is not accepted."""
    for name in ("os", "__init__", "Plain", "a.b", ""):
        with pytest.raises(SceneError, match="unknown experiment"):
            experiment_of(name)
