"""PettingZoo environment: robots of a scene as agents, with wheel speeds as actions (optional extra `learning`).

World, sensors and supervisor are those of a trial. Equal seeds and actions give equal observations and rewards.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray
from pettingzoo import ParallelEnv

from arena.experiments import Experiment, TrialSamples, experiment_of
from arena.experiments.supervisor import Supervisor, SupervisorHooks
from arena.infrared.channel import OpticalChannel
from arena.replay.video import arena_picture
from arena.robots.controller import Controller, ScriptedController
from arena.robots.firmware_controller import FirmwareController
from arena.robots.senses import SenseReader, Senses
from arena.robots.user_controller import Policy, load_controller
from arena.scene import dimensions
from arena.scene.loader import FCY, Scene, load_scene, scripted
from arena.scene.robot_kind import EPUCK
from arena.world.physics import World

SENSED: Final = 3
"""One-hot code of the line-of-sight sensor: nothing, object, robot."""
SIZE: Final = SENSED + 8 + 8 + 2
"""Length of an observation: line-of-sight code, then `Senses.proximity`, `Senses.light` and the two wheel speeds."""
Reward = Callable[[Supervisor], float]
Command = Callable[[float, float], bytes]
"""Function that translates wheel speeds in -1..1, left and right, to the bytes that a robot receives by Bluetooth."""
Vector = NDArray[np.float32]


def serial_command(left: float, right: float) -> bytes:
    """Return the command `D,left,right` in steps/s of the robot's text protocol (epuck.md §6)."""
    return f"D,{round(1000 * left)},{round(1000 * right)}\r".encode()


def _speeds(agent: str, action: ArrayLike) -> tuple[float, float]:
    """Return the wheel speeds of an action, limited to -1..1. Raises ValueError."""
    try:
        values = np.asarray(action, dtype=float)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.shape != (2,) or not np.isfinite(values).all():
        raise ValueError(f"action of {agent}: {action!r:.80}: expected two finite numbers, the speeds of both wheels")
    left, right = np.clip(values, -1.0, 1.0).tolist()
    return left, right


class ArenaEnv(ParallelEnv):  # type: ignore[misc]
    """Environment of `scene`, which is a name, a path or a value.

    An action holds for `decision_s` seconds: speeds of the left and right wheel, in -1..1 of 12.8 cm/s. The reward is
    equal for all robots: the increase of the experiment's first metric, or `reward(supervisor)`. With `image` the
    robots run firmware, and `command` translates each action into a Bluetooth message. An episode is truncated after
    `seconds` simulated seconds and terminated by the experiment's `done`. With `render_mode="rgb_array"`, `render`
    returns a picture of the arena from above.

        >>> from arena.env import ArenaEnv
        >>> env = ArenaEnv("aggregation", seconds=1.0)
        >>> observations, _ = env.reset(seed=1)
        >>> len(observations), observations[env.agents[0]].shape
        (8, (21,))
        >>> actions = {agent: (0.5, 0.5) for agent in env.agents}
        >>> _, rewards, _, truncations, _ = env.step(actions)
        >>> any(truncations.values())
        False

    A pickled or copied environment repeats its episode from the seed and the actions, which gives the same numbers;
    changes by `supervisor` are not repeated.

    Raises SceneError, emu.LoadError, ValueError.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "arena_v0", "render_modes": ["rgb_array"]}

    def __init__(
        self,
        scene: str | Scene = "aggregation",
        *,
        seconds: float = 60.0,
        decision_s: float = 0.1,
        reward: Reward | None = None,
        image: Path | None = None,
        command: Command = serial_command,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode = {render_mode!r}: expected None or 'rgb_array'")
        self.render_mode = render_mode
        self._settings: Final = {"seconds": seconds, "decision_s": decision_s, "reward": reward, "image": image,
                                 "command": command, "render_mode": render_mode}  # fmt: skip
        found = load_scene(scene) if isinstance(scene, str) else scene
        if isinstance(scene, str) and found.experiment.endswith(".py"):
            found = replace(found, experiment=str((Path(scene).parent / found.experiment).resolve()))
        self.scene: Final = found if image is not None else scripted(found)
        if any(group.kind != EPUCK.name for group in self.scene.groups):
            raise ValueError(f"{self.scene.name}: robots.kind: an environment has e-pucks only")
        self.experiment: Final[Experiment] = experiment_of(self.scene.experiment)
        self._ticks: Final = round(decision_s * FCY / self.scene.clock.quantum_tcy)
        if self._ticks < 1 or not seconds > 0:
            raise ValueError(
                f"decision_s = {decision_s:g}, seconds = {seconds:g}: expected a quantum or more, and a positive number"
            )
        self._seconds: Final = seconds
        self._reward: Final = reward
        self._image: Final = image
        self._command: Final = command
        self.possible_agents = [f"robot_{robot}" for robot in range(self.scene.robots.count)]
        self.agents: list[str] = []
        self._next_seed = 0
        self._taken: list[dict[str, Vector]] = []
        """Actions of the episode so far."""
        self._has_begun = False
        self._controllers: list[Controller] = []
        self._action: Final = Box(-1.0, 1.0, (2,), np.float32)
        self._observation: Final = Box(-1.0, 1.0, (SIZE,), np.float32)

    def action_space(self, agent: str) -> Box:
        """Return the space of actions: speeds of the left and right wheel."""
        return self._action

    def observation_space(self, agent: str) -> Box:
        """Return the space of observations: `SIZE` numbers in -1..1."""
        return self._observation

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Vector], dict[str, dict[str, Any]]]:
        """Start a trial with `seed`, or with the seed after the last one; return observations and empty infos."""
        self.close()
        self._next_seed = (self._next_seed if seed is None else seed) + 1
        chosen = self._next_seed - 1
        count = self.scene.robots.count
        self.agents = self.possible_agents[:]
        self._world = World(self.scene, chosen)
        channel = OpticalChannel.of(self.scene)
        if self._image is None:
            self._controllers = [ScriptedController(self.scene, chosen, robot, "A") for robot in range(count)]
        else:
            self._controllers = [
                FirmwareController(self.scene, chosen, robot, self._image, 0, channel) for robot in range(count)
            ]
        self._hooks = SupervisorHooks(self.experiment, Supervisor(self._world, self._controllers, chosen))
        self._readers = [SenseReader(self.scene, chosen, robot) for robot in range(count)]
        self._speeds = [(0.0, 0.0)] * count
        self._value = self._metric()
        self._taken, self._has_begun = [], True
        return self._observed(), {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, Vector]
    ) -> tuple[dict[str, Vector], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Apply the actions for `decision_s` seconds.

        A robot without an action stops. Return observations, rewards, terminations, truncations and infos. Raises
        ValueError, and changes nothing, if an action is not two finite numbers."""
        self._speeds = [_speeds(agent, actions.get(agent, (0.0, 0.0))) for agent in self.agents]
        self._taken.append({agent: np.array(one, dtype=float) for agent, one in actions.items()})
        wheels = [(left * dimensions.WHEEL_SPEED, right * dimensions.WHEEL_SPEED) for left, right in self._speeds]
        if self._image is not None:
            for controller, speeds in zip(self._controllers, self._speeds, strict=True):
                controller.feed_uart(self._command(*speeds))
        over = False
        for _ in range(self._ticks):
            if self._image is not None:
                tick, poses = self._world.ticks, self._world.poses
                wheels = [controller.control_step(tick, poses) for controller in self._controllers]
            self._world.step(wheels)
            over = self._hooks.step() or over
        before, self._value = self._value, self._metric()
        gain = self._value - before if self._reward is None else self._reward(self._hooks.supervisor)
        late = self._world.seconds >= self._seconds - self._world.dt / 2
        agents, seen = self.agents, self._observed()
        if over or late:
            self.agents = []
        return (
            seen,
            dict.fromkeys(agents, float(gain)),
            dict.fromkeys(agents, over),
            dict.fromkeys(agents, late and not over),
            {agent: {"metric": self._value} for agent in agents},
        )

    @property
    def state_space(self) -> Box:
        """Space of `state`."""
        scene, kinds = self.scene, map(self.scene.kind_of, range(self.scene.objects.count))
        size = 3 * scene.robots.count + 2 * scene.objects.count + sum(bool(kind.polygon) for kind in kinds)
        return Box(-np.inf, np.inf, (size,), np.float64)

    def state(self) -> NDArray[np.float64]:
        """Return the poses of all bodies: x and y in cm and heading in rad of each robot, then x and y of each object,
        then the headings of the objects that are polygons. Call `reset` first."""
        return self._world.poses.values.copy()

    def render(self) -> NDArray[np.uint8]:
        """Return a picture of the arena from above, height x width x 3. Raises ValueError without a `render_mode`."""
        if self.render_mode is None:
            raise ValueError('render: create the environment with render_mode="rgb_array"')
        seen = [self.senses(agent).seen for agent in self.possible_agents]
        labels = self.experiment.groups(self.scene, self._hooks.supervisor.objects)
        picture = arena_picture(self.scene, self._world.poses.robots, seen, self._world.object_poses(), labels)
        return np.array(picture)

    def __reduce__(self) -> tuple[Callable[..., ArenaEnv], tuple[Any, ...]]:
        """Pickle and copy as the inputs from which the episode can be repeated."""
        return _repeat_episode, (self.scene, self._settings, self._next_seed, self._has_begun, self._taken)

    @property
    def supervisor(self) -> Supervisor:
        """Supervisor of the running trial, to read and change its world. Call `reset` first."""
        return self._hooks.supervisor

    @property
    def stage(self) -> Supervisor:
        """Old spelling of `supervisor`, which this release still accepts."""
        warnings.warn("ArenaEnv.stage is called supervisor now", DeprecationWarning, stacklevel=2)
        return self.supervisor

    @property
    def controllers(self) -> list[Controller]:
        """Controllers of the robots, in order."""
        return self._controllers

    @property
    def brains(self) -> list[Controller]:
        """Old spelling of `controllers`, which this release still accepts."""
        warnings.warn("ArenaEnv.brains is called controllers now", DeprecationWarning, stacklevel=2)
        return self.controllers

    def senses(self, agent: str) -> Senses:
        """Return what an agent senses now, as the controller of a trial gets it. Call `reset` first."""
        robot = self.possible_agents.index(agent)
        left, right = self._speeds[robot]
        wheels = (left * dimensions.WHEEL_SPEED, right * dimensions.WHEEL_SPEED)
        return self._readers[robot].read(self._world.poses, self._world.seconds, wheels)

    def policy(self, path: Path) -> Callable[[], dict[str, Vector]]:
        """Return a function that returns the actions of a controller in a Python file (robots/user_controller.py).

        It holds one instance of the controller per agent, with the random generators of a trial with this seed; create
        it after `reset`. Raises SceneError, also when the controller fails."""
        loaded = load_controller(path.resolve())
        seed = self._next_seed - 1
        own = {agent: Policy(loaded, seed, robot) for robot, agent in enumerate(self.possible_agents)}

        def actions() -> dict[str, Vector]:
            speeds = {agent: own[agent].step(self.senses(agent)) for agent in self.agents}
            return {agent: np.array(one, dtype=np.float32) / np.float32(dimensions.WHEEL_SPEED)
                    for agent, one in speeds.items()}  # fmt: skip

        return actions

    def close(self) -> None:
        """Close the controllers of the robots and their machines."""
        for controller in self._controllers:
            controller.close()
        self._controllers = []

    def _metric(self) -> float:
        """Return the present value of the experiment's first metric."""
        supervisor = self._hooks.supervisor
        noted = {name: np.array([value]) for name, value in supervisor.noted.items()}
        moment = TrialSamples(
            np.array([supervisor.seconds]), supervisor.robots[None], supervisor.objects[None], self.scene, noted
        )
        return self.experiment.series(moment).last(self.experiment.curves[0].name)

    def _observed(self) -> dict[str, Vector]:
        """Return the observation of each agent."""
        found = {}
        for robot, agent in enumerate(self.agents):
            sensed, now = [0.0] * SENSED, self.senses(agent)
            sensed[now.seen] = 1.0
            values = (*sensed, *now.proximity, *now.light, *self._speeds[robot])
            found[agent] = np.clip(np.array(values, dtype=np.float32), -1, 1)
        return found


def _repeat_episode(scene: Scene, settings: dict[str, Any], next_seed: int, has_begun: bool,
                    actions: list[dict[str, Vector]]) -> ArenaEnv:  # fmt: skip
    """Return an environment whose episode has repeated these actions."""
    env = ArenaEnv(scene, **settings)
    env._next_seed = next_seed
    if has_begun:
        env.reset(seed=next_seed - 1)
        for one in actions:
            env.step(one)
    return env
