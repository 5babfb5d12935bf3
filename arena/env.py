"""A PettingZoo environment: robots of a scene as agents, with wheel speeds as actions (optional extra `learning`).

What enters: a scene, seeds, actions; what leaves: what each robot senses, and a reward. The world, the sensors and the
supervisor are those of a trial. Same seed and actions, same numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from arena.camera.renderer import Sight
from arena.experiments import Experiment, Moments, experiment_of
from arena.experiments.supervisor import Stage, Supervised
from arena.infrared.channel import Ether
from arena.infrared.propagation import Optics
from arena.infrared.ring import ambient
from arena.robots.controller import Brain, ScriptedBrain
from arena.robots.firmware_controller import EmulatedBrain
from arena.scene import dimensions
from arena.scene.loader import FCY, Scene, load_scene, scripted
from arena.world.physics import World, traits_of
from emu.boards.epuck.analog import reflection_at

SENSED: Final = 3
"""Nothing, object, robot: the line-of-sight sensor, one of three numbers is 1."""
SIZE: Final = SENSED + 8 + 8 + 2
"""Then eight reflections (1 = touching white), eight lights (1 = dark), and the speeds in force."""
FULL_REFLECTION: Final = 3788.0
"""Counts of the nearest white surface (epuck.md §5)."""
FULL_LIGHT: Final = 4095.0
Reward = Callable[[Stage], float]
Command = Callable[[float, float], bytes]
"""command(left, right) in -1..1: what a robot with firmware is told by Bluetooth."""
Vector = NDArray[np.float32]


def serial_command(left: float, right: float) -> bytes:
    """`D,left,right` in steps/s, as the robot's own text protocol has it (epuck.md §6)."""
    return f"D,{round(1000 * left)},{round(1000 * right)}\r".encode()


class ArenaEnv(ParallelEnv):  # type: ignore[misc]
    """`scene` by name, path or value; an action, left and right in -1..1 of 12.8 cm/s, holds for `decision_s`.

    The reward, the same for all robots, is how much the experiment's first metric grew; or `reward(stage)`. With
    `image` robots have firmware, and an action is what they are told by Bluetooth (`command`). An episode is truncated
    after `seconds`, terminated by the experiment's `done`. Raises SceneError, emu.LoadError, ValueError.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "arena_v0", "render_modes": []}
    render_mode = None

    def __init__(
        self,
        scene: str | Scene = "aggregation",
        *,
        seconds: float = 60.0,
        decision_s: float = 0.1,
        reward: Reward | None = None,
        image: Path | None = None,
        command: Command = serial_command,
    ) -> None:
        found = load_scene(scene) if isinstance(scene, str) else scene
        home = Path(scene).parent if isinstance(scene, str) else Path()
        self.scene: Final = found if image is not None else scripted(found)
        self.experiment: Final[Experiment] = experiment_of(self.scene.experiment, home)
        self._ticks: Final = round(decision_s * FCY / self.scene.clock.quantum_tcy)
        if self._ticks < 1 or not seconds > 0:
            raise ValueError(
                f"decision_s {decision_s:g} is shorter than a quantum, or seconds {seconds:g} not positive"
            )
        self._seconds: Final = seconds
        self._reward: Final = reward
        self._image: Final = image
        self._command: Final = command
        self.possible_agents = [f"robot_{robot}" for robot in range(self.scene.robots.count)]
        self.agents: list[str] = []
        self._next_seed = 0
        self._brains: list[Brain] = []
        self._action: Final = Box(-1.0, 1.0, (2,), np.float32)
        self._observation: Final = Box(-1.0, 1.0, (SIZE,), np.float32)

    def action_space(self, agent: str) -> Box:
        """Left and right wheel."""
        return self._action

    def observation_space(self, agent: str) -> Box:
        """What a robot senses (SIZE)."""
        return self._observation

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Vector], dict[str, dict[str, Any]]]:
        """A new trial of that seed, of the next one if none is given."""
        self.close()
        self._next_seed = (self._next_seed if seed is None else seed) + 1
        chosen = self._next_seed - 1
        count = self.scene.robots.count
        self.agents = self.possible_agents[:]
        self._world = World(self.scene, chosen)
        self._optics = Optics(self.scene)
        ether = Ether.of(self.scene)
        if self._image is None:
            self._brains = [ScriptedBrain(self.scene, chosen, robot, "A") for robot in range(count)]
        else:
            self._brains = [EmulatedBrain(self.scene, chosen, robot, self._image, 0, ether) for robot in range(count)]
        self._supervised = Supervised(self.experiment, Stage(self._world, self._brains, chosen))
        self._sights = [Sight(self.scene, robot, traits_of(self.scene, chosen, robot)) for robot in range(count)]
        self._speeds = [(0.0, 0.0)] * count
        self._value = self._metric()
        return self._observed(), {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, Vector]
    ) -> tuple[dict[str, Vector], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Let every robot do as told for `decision_s`."""
        wanted = [np.clip(np.asarray(actions.get(agent, (0, 0)), dtype=float), -1, 1) for agent in self.agents]
        self._speeds = [(float(left), float(right)) for left, right in wanted]
        wheels = [(left * dimensions.WHEEL_SPEED, right * dimensions.WHEEL_SPEED) for left, right in self._speeds]
        if self._image is not None:
            for brain, speeds in zip(self._brains, self._speeds, strict=True):
                brain.tell(self._command(*speeds))
        over = False
        for _ in range(self._ticks):
            if self._image is not None:
                tick, poses = self._world.ticks, self._world.poses
                wheels = [brain.think(tick, poses) for brain in self._brains]
            self._world.step(wheels)
            over = self._supervised.is_over() or over
        before, self._value = self._value, self._metric()
        gain = self._value - before if self._reward is None else self._reward(self._supervised.stage)
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
    def stage(self) -> Stage:
        """The running trial as a supervisor has it: to look and to move things. Call `reset` first."""
        return self._supervised.stage

    @property
    def brains(self) -> list[Brain]:
        """The robots' brains, in order: what those with firmware said and showed."""
        return self._brains

    def close(self) -> None:
        """Give back the robots' machines."""
        for brain in self._brains:
            brain.close()
        self._brains = []

    def _metric(self) -> float:
        """The experiment's first metric of this moment."""
        stage = self._supervised.stage
        noted = {name: np.array([value]) for name, value in stage.noted.items()}
        moment = Moments(np.array([stage.seconds]), stage.robots[None], stage.objects[None], self.scene, noted)
        return self.experiment.course(moment).last(self.experiment.curves[0].name)

    def _observed(self) -> dict[str, Vector]:
        poses = self._world.poses
        found = {}
        for robot, agent in enumerate(self.agents):
            sensed = [0.0] * SENSED
            self._sights[robot].look(poses)
            sensed[self._sights[robot].sensor()] = 1.0
            near = [share * reflection_at(distance) / FULL_REFLECTION if math.isfinite(distance) else 0.0
                    for distance, share in self._optics.surfaces(poses, robot)]  # fmt: skip
            light = [counts / FULL_LIGHT for counts in ambient(self.scene, poses.robots[robot])]
            values = (*sensed, *near, *light, *self._speeds[robot])
            found[agent] = np.clip(np.array(values, dtype=np.float32), -1, 1)
        return found
