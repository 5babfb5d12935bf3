"""Controllers in Python files: trials, records, permissions and messages."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from arena.cli import main
from arena.robots.user_controller import Policy, load_controller
from arena.scene.loader import SceneError, load_scene
from arena.trial.record import read_trial

EXAMPLE = Path(__file__).parents[3] / "docs/examples/turn_away.py"
STRAIGHT = "class Controller:\n    def __init__(self, robot, rng): pass\n    def step(self, senses): return 9.0, 9.0\n"
RUN = ("--trials", "1", "--minutes", "0.1", "--jobs", "1")


def run(*arguments: object) -> int:
    """Return the exit status of `arena run clustering` with a short trial."""
    return main(["run", "clustering", *RUN, *map(str, arguments)])


def test_a_run_with_an_own_controller_is_recorded_and_repeatable(tmp_path: Path) -> None:
    """Equal seeds give equal records; the folder has a copy of the file, and the manifest its hash."""
    for name in ("a", "b"):
        assert run("--controller", EXAMPLE, "--out", tmp_path / name) == 0
    first, second = ((tmp_path / name / "trial-0001.parquet").read_bytes() for name in ("a", "b"))
    assert first == second
    assert (tmp_path / "a/controller-1.py").read_bytes() == EXAMPLE.read_bytes()
    key = json.loads((tmp_path / "a/manifest.json").read_text())["key"]
    assert (key["brain"], key["controller"]) == ("scripted", "turn_away.py")
    assert list(key["controllers_sha256"]) == ["turn_away.py"]
    columns = read_trial(tmp_path / "a/trial-0001.parquet").columns
    assert abs(columns["r0_x"][-1] - columns["r0_x"][0]) + abs(columns["r0_y"][-1] - columns["r0_y"][0]) > 10


def test_a_changed_file_is_another_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder with trials of another version of the controller is refused."""
    own = tmp_path / "own.py"
    own.write_text(STRAIGHT)
    assert run("--controller", own, "--out", tmp_path / "out") == 0
    own.write_text(STRAIGHT.replace("9.0, 9.0", "9.0, 8.0"))
    assert run("--controller", own, "--out", tmp_path / "out") == 2
    assert "different controllers_sha256" in capsys.readouterr().err


def test_groups_have_controllers_of_their_own(tmp_path: Path) -> None:
    """A group runs the file that its scene names, relative to the scene; other groups use the table of the run."""
    (tmp_path / "own.py").write_text(STRAIGHT)
    scene = tmp_path / "two.toml"
    scene.write_text('name = "two"\n[start]\nremote = ""\n[chassis]\nwheel_noise = 0.0\n'
                     + '[[robots]]\ncontroller = "own.py"\nplace = "poses"\nposes = [[100, 100, 0]]\n'
                     + '[[robots]]\nplace = "poses"\nposes = [[100, 200, 0]]\n')  # fmt: skip
    assert main(["run", str(scene), *RUN, "--brain", "scripted", "--out", str(tmp_path / "out")]) == 0
    columns = read_trial(tmp_path / "out/trial-0001.parquet").columns
    assert columns["r0_y"][-1] == pytest.approx(100, abs=0.1)
    assert columns["r0_x"][-1] == pytest.approx(100 + 9.0 * 6, rel=0.02)
    assert abs(columns["r1_y"][-1] - 200) > 1


def test_verify_runs_the_controller_of_a_bundle_only_with_permission(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without --trust the code in a bundle is refused; with it, the repeated trial is equal."""
    assert run("--controller", EXAMPLE, "--out", tmp_path / "run") == 0
    bundle = str(tmp_path / "b.zip")
    assert main(["bundle", bundle, str(tmp_path / "run")]) == 0
    assert main(["verify", bundle]) == 2
    assert "accept the copies in the bundle with --trust" in capsys.readouterr().err
    assert main(["verify", bundle, "--trust"]) == 0


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("x = 1\n", "expected a class Controller with the methods"),
        ("PERIOD_S = 0\n" + STRAIGHT, "PERIOD_S is 0; expected 0.001 to 60 seconds"),
        ("import nowhere_at_all\n", "own.py:1: ModuleNotFoundError"),
        (STRAIGHT.replace("9.0, 9.0", "float('nan'), 1"), "robot 0: step returned (nan, 1); expected two numbers"),
        (STRAIGHT.replace("9.0, 9.0", "None"), "robot 0: step returned None; expected two numbers"),
        (STRAIGHT.replace("9.0, 9.0", "1 / 0"), "controller-1.py:3: robot 0: ZeroDivisionError"),
    ],
)
def test_a_wrong_file_is_reported_in_one_line(
    code: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A controller that is missing, fails or answers nonsense ends the run with status 2, file and line."""
    own = tmp_path / "own.py"
    own.write_text(code)
    assert run("--controller", own, "--out", tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert words in error
    assert "Traceback" not in error


@pytest.mark.slow
def test_firmware_and_a_controller_in_python_exclude_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--brain` with firmware refuses a controller in Python; unknown names are listed with what is expected."""
    assert run("--controller", EXAMPLE, "--brain", "openswarm", "--out", tmp_path / "out") == 2
    assert "runs in Python: use it without --brain openswarm" in capsys.readouterr().err
    assert run("--controller", "C", "--out", tmp_path / "out") == 2
    words = "unknown controller 'C'; expected A, B, aggregate, transport, the path of a .py file"
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_firmware_replaces_the_controllers_in_python_of_a_scene(tmp_path: Path, talking_image: Path) -> None:
    """`--brain FILE` runs the firmware in a scene whose groups all name a controller in Python; `--brain scripted` runs
    that controller."""
    for brain, is_firmware in ((str(talking_image), True), ("scripted", False)):
        out = tmp_path / Path(brain).stem
        main(["run", "chen2015", "--brain", brain, *RUN[:3], "0.01", *RUN[4:], "--robots", "2", "--out", str(out)])
        trial = read_trial(out / "trial-0001.parquet")
        assert bool(trial.about["image_sha256"]) == is_firmware == (not trial.is_scripted)
        assert bool(trial.about.get("controllers_sha256")) == (not is_firmware)


def test_the_same_file_controls_agents_of_the_learning_environment() -> None:
    """`ArenaEnv.policy` returns the actions of the file; robots move and stay within the speeds of the action space."""
    pytest.importorskip("pettingzoo", reason="PettingZoo is not installed (extra: learning)")
    from arena.env import ArenaEnv

    env = ArenaEnv(load_scene("aggregation"), seconds=2.0)
    env.reset(seed=3)
    policy = env.policy(EXAMPLE)
    while env.agents:
        actions = policy()
        assert all(np.abs(one).max() <= 1 for one in actions.values())
        env.step(actions)
    assert any(np.abs(one).max() > 0.3 for one in actions.values())


def test_speeds_are_limited_to_those_of_the_robot(tmp_path: Path) -> None:
    """A policy returns at most 12.8 cm/s forwards and backwards."""
    own = tmp_path / "own.py"
    own.write_text(STRAIGHT.replace("9.0, 9.0", "1e9, -1e9"))
    assert Policy(load_controller(own), 1, 0).step(None) == (12.8, -12.8)  # type: ignore[arg-type]


def test_a_file_with_another_hash_is_not_run(tmp_path: Path) -> None:
    """A file whose SHA-256 is not the recorded one is refused before its code runs."""
    own = tmp_path / "own.py"
    own.write_text("raise SystemExit('ran')\n")
    with pytest.raises(SceneError, match="is not the recorded controller"):
        load_controller(own, "0" * 64)
