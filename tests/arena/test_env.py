"""Learning environment: PettingZoo's own tests, reproducibility, and evolution of a controller for firmware."""

from __future__ import annotations

import importlib.util
import math
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tests.watchdog import HANG

pytest.importorskip("pettingzoo", reason="PettingZoo is not installed (extra: learning)")

from pettingzoo.test import parallel_api_test, parallel_seed_test

from arena.camera.appearance import OBJECT, ROBOT
from arena.env import SENSED, SIZE, ArenaEnv, serial_command
from arena.scene.loader import load_scene
from tests.arena.robot_programs import ECHO

ROOT = Path(__file__).resolve().parents[2]


def test_pettingzoos_own_tests_pass() -> None:
    """PettingZoo's tests of API and seeding pass."""
    parallel_api_test(ArenaEnv("aggregation", seconds=2.0), num_cycles=50)
    parallel_seed_test(lambda: ArenaEnv("aggregation", seconds=1.0), num_cycles=20)


def test_the_same_seed_and_actions_give_the_same_numbers() -> None:
    """Equal seeds give equal numbers; without a seed, `reset` uses the next one."""
    env = ArenaEnv("foraging", seconds=2.0)

    def series(seed: int | None) -> list[np.ndarray]:
        observed, _ = env.reset(seed=seed)
        rng, found = np.random.default_rng(0), []
        while env.agents:
            actions = {agent: rng.uniform(-1, 1, 2).astype(np.float32) for agent in env.agents}
            observed, *_ = env.step(actions)
            found.append(np.stack(list(observed.values())))
        return found

    first, again, other = series(5), series(5), series(None)
    assert len(first) == 20
    assert all((one == two).all() for one, two in zip(first, again, strict=True))
    assert not all((one == two).all() for one, two in zip(first, other, strict=True))
    assert all((one == two).all() for one, two in zip(other, series(6), strict=True))


def test_a_pickled_environment_continues_as_the_original() -> None:
    """A copy in the middle of an episode has the state of the original, and both continue with the same numbers."""
    env = ArenaEnv("chen2015", seconds=2.0, render_mode="rgb_array")
    env.reset(seed=4)
    actions = {agent: np.array([1.0, 0.5], np.float32) for agent in env.agents}
    for _ in range(3):
        env.step(actions)
    copied = pickle.loads(pickle.dumps(env))
    assert (copied.state() == env.state()).all()
    assert env.state().shape == env.state_space.shape == (3 * 20 + 2 + 1,)
    for one, two in zip(env.step(actions), copied.step(actions), strict=True):
        np.testing.assert_equal(one, two)
    assert (copied.reset()[0]["robot_0"] == env.reset()[0]["robot_0"]).all()
    picture = env.render()
    assert (picture.shape, picture.dtype) == ((360, 640, 3), np.uint8)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 3


def test_old_spellings_are_accepted_with_a_warning() -> None:
    """`stage` and `brains` are the properties `supervisor` and `controllers`, and warn."""
    env = ArenaEnv("aggregation", seconds=1.0)
    env.reset(seed=1)
    with pytest.warns(DeprecationWarning, match="called supervisor now"):
        assert env.stage is env.supervisor
    with pytest.warns(DeprecationWarning, match="called controllers now"):
        assert env.brains is env.controllers


def test_the_render_mode_is_checked() -> None:
    """Only pictures as arrays exist; `render` without a mode is refused."""
    with pytest.raises(ValueError, match="render_mode = 'human': expected None or 'rgb_array'"):
        ArenaEnv("aggregation", render_mode="human")
    with pytest.raises(ValueError, match='create the environment with render_mode="rgb_array"'):
        ArenaEnv("aggregation").render()


def test_a_vector_environment_is_several_worlds_that_restart() -> None:
    """Rows are the robots of all worlds; each equals the single environment of its seed, also after the restart."""
    from arena.vector_env import ArenaVectorEnv

    vector = ArenaVectorEnv(2, scene="aggregation", seconds=0.3)
    observed, _ = vector.reset(seed=5)
    assert observed.shape == vector.observation_space.shape == (16, SIZE)
    single, actions = ArenaEnv("aggregation", seconds=0.3), np.tile(np.array([0.5, 1.0], np.float32), (16, 1))
    for step in range(5):
        expected = []
        for seed in (5, 6):
            seen, _ = single.reset(seed=seed + 2 * (step >= 3))
            for _ in range(step - 3 * (step >= 3)):
                seen, *_ = single.step(dict(zip(single.agents, actions, strict=False)))
            expected += list(seen.values())
        assert (observed == np.array(expected)).all(), step
        observed, rewards, over, late, infos = vector.step(actions)
        assert (rewards.shape, over.any(), late.all()) == ((16,), False, step == 2)
        assert ("final_obs" in infos) == (step == 2)
    vector.close()
    with pytest.raises(ValueError, match="0 worlds: expected at least one"):
        ArenaVectorEnv(0, scene="aggregation")


def test_robots_sense_what_stands_before_them_and_move_as_told() -> None:
    """Observations contain the robot and object ahead, the wall by infrared, light and speeds; full speed is 12.8
    cm/s."""
    scene = load_scene("foraging").with_values(robots__wheel_noise=0.0, clock__scripted_quantum_ms=10.0)
    env = ArenaEnv(scene, seconds=5.0, decision_s=0.5)
    env.reset(seed=1)
    env.supervisor.move_robot(0, 100, 75, 0.0)
    env.supervisor.move_robot(1, 130, 75, math.pi)
    env.supervisor.move_robot(2, 10, 20, math.pi + math.radians(18))
    for number in range(6):
        env.supervisor.move_object(number, 180, 10 + 20 * number)
    observed, rewards, over, late, _ = env.step({"robot_0": np.array([1, 1]), "robot_1": np.array([0.5, -0.5])})
    assert env.supervisor.robots[0, 0] == pytest.approx(106.4, abs=0.2)
    seen = observed["robot_0"]
    assert seen.shape == (SIZE,)
    assert seen[:SENSED].argmax() == ROBOT
    assert seen[-2:].tolist() == [1.0, 1.0]
    assert observed["robot_2"][SENSED] > 0.03  # sensor 0 faces the wall at 6.3 cm
    assert observed["robot_2"][SENSED + 8 :][:8].min() < 0.9  # a sensor that faces the lamp
    assert (sum(rewards.values()), any(over.values()), any(late.values())) == (0.0, False, False)
    env.supervisor.move_robot(1, 20, 140, 0.0)
    env.supervisor.move_object(0, 130, 75)
    observed, *_ = env.step({})
    assert observed["robot_0"][:SENSED].argmax() == OBJECT


def test_food_brought_home_is_a_reward() -> None:
    """The reward is the delivered food, which is the experiment's first metric; the supervisor acts as in a trial."""
    env = ArenaEnv("foraging", seconds=5.0, decision_s=0.2)
    env.reset(seed=1)
    env.supervisor.move_object(0, 100, 75)
    env.supervisor.move_robot(0, 100 - 7, 75, 0.0)
    env.step({})
    env.supervisor.move_robot(0, 40, 75)
    _, rewards, *_ = env.step({})
    assert set(rewards.values()) == {1.0}
    mine = ArenaEnv("foraging", seconds=1.0, reward=lambda supervisor: supervisor.seconds)
    mine.reset(seed=1)
    assert mine.step({})[1]["robot_0"] == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize(
    "action", [[math.nan, 0.5], [0.5, math.inf], [-math.inf, 0], [1], [1, 1, 1], 1.0, None, "up", [None, 1]]
)
def test_an_action_that_is_not_two_finite_numbers_is_refused(action: object) -> None:
    """A step with an action other than two finite numbers is refused and changes nothing; the episode continues as
    without it."""
    episodes = []
    for is_disturbed in (False, True):
        env = ArenaEnv("aggregation", seconds=1.0)
        env.reset(seed=1)
        env.step({agent: np.array([0.5, 0.4]) for agent in env.agents})
        if is_disturbed:
            with pytest.raises(ValueError, match=r"action of robot_3: .*: expected two finite numbers"):
                env.step({"robot_0": np.array([1, 1]), "robot_3": action})  # type: ignore[dict-item]
        observed, rewards, *_ = env.step({agent: np.array([2.0, -3.0]) for agent in env.agents})
        episodes.append((np.stack(list(observed.values())), rewards, env.supervisor.robots))
    (first, gain, poses), (second, other_gain, other_poses) = episodes
    assert np.isfinite(first).all()
    assert (first == second).all()
    assert (poses == other_poses).all()
    assert gain == other_gain


def test_robots_with_firmware_are_told_by_bluetooth(assembled: Callable[[str], Path]) -> None:
    """Robots with firmware receive actions by Bluetooth, as commands of the robot's text protocol."""
    scene = load_scene("foraging").with_values(start__remote="")
    env = ArenaEnv(scene, seconds=1.0, decision_s=0.2, image=assembled(ECHO))
    env.reset(seed=1)
    env.step({agent: np.array([0.5, -0.25]) for agent in env.agents})
    env.step({})
    for controller in env.controllers:
        controller.reading()
        assert [line.text for line in controller.take_lines()] == ["D,500,-250", "D,0,0"]
    assert serial_command(1, -1) == b"D,1000,-1000\r"
    env.close()


def test_what_cannot_be_is_refused() -> None:
    """Invalid arguments of the environment raise ValueError with a message."""
    with pytest.raises(ValueError, match="expected a quantum or more"):
        ArenaEnv("aggregation", decision_s=0.001)
    with pytest.raises(ValueError, match="a positive number"):
        ArenaEnv("aggregation", seconds=0)


def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("evolve_aggregation", ROOT / "docs/examples/evolve_aggregation.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_a_controller_is_evolved_and_becomes_firmware(tmp_path: Path) -> None:
    """The evolved controller is at least as good as the first one, depends only on the seed, and its constants
    compile."""
    evolve = example().evolve
    best, series = evolve(4, [0], 10.0, 3)
    assert series == sorted(series, reverse=True)
    again, _ = evolve(4, [0], 10.0, 3)
    assert (best == again).all()
    defines = f"-DALONE={best[0]},{best[1]} -DAHEAD={best[2]},{best[3]}"
    command = ["make", "-C", str(ROOT / "firmware"), "APP=aggregation", f"OUT={tmp_path}", f"DEFINES={defines}",
               f"PYTHON={sys.executable}"]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANG, check=False)
    assert done.returncode == 0, done.stderr
