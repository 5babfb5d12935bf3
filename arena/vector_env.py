"""Vectorised learning environment: the robots of several worlds in one process (optional extra `learning`)."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from arena.env import SIZE, ArenaEnv, Vector

Flags = NDArray[np.bool_]


class ArenaVectorEnv(VectorEnv[Vector, Vector, NDArray[Any]]):
    """`worlds` copies of an `ArenaEnv` as a vector environment with one row per robot, world by world.

    `settings` are those of `ArenaEnv`. A world whose episode ends begins the next one in the same step, with a seed
    that no world has used; `infos["final_obs"]` has the last observations of the old episode where
    `infos["_final_obs"]` is true. Raises as `ArenaEnv`, and ValueError for less than one world or robot."""

    def __init__(self, worlds: int, **settings: Any) -> None:
        self._worlds: Final = [ArenaEnv(**settings) for _ in range(worlds)]
        self._robots: Final = len(self._worlds[0].possible_agents) if worlds > 0 else 0
        if not self._robots:
            raise ValueError(f"{worlds} worlds: expected at least one, with at least one robot")
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP, "render_modes": ["rgb_array"]}
        agent = self._worlds[0].possible_agents[0]
        self.render_mode = self._worlds[0].render_mode
        self.num_envs = worlds * self._robots
        self.single_observation_space = self._worlds[0].observation_space(agent)
        self.single_action_space = self._worlds[0].action_space(agent)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._next_seed = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Vector, dict[str, Any]]:
        """Start a trial in each world, with the seeds from `seed` on; return observations and an empty info."""
        self._next_seed = self._next_seed if seed is None else seed
        return np.concatenate([self._restart(world) for world in self._worlds]), {}

    def step(self, actions: Vector) -> tuple[Vector, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Apply one action per row; return observations, rewards, terminations, truncations and infos."""
        values = np.asarray(actions, dtype=float).reshape(len(self._worlds), self._robots, -1)
        rewards, over, late = np.zeros(self.num_envs), np.zeros(self.num_envs, bool), np.zeros(self.num_envs, bool)
        observed, final = [], np.zeros((self.num_envs, SIZE), np.float32)
        for number, world in enumerate(self._worlds):
            rows = slice(number * self._robots, (number + 1) * self._robots)
            agents = world.agents
            seen, gains, ends, limits, _ = world.step(dict(zip(agents, values[number], strict=True)))
            rewards[rows], over[rows], late[rows] = ([found[one] for one in agents] for found in (gains, ends, limits))
            rows_seen = np.stack([seen[one] for one in agents])
            if not world.agents:
                final[rows] = rows_seen
                rows_seen = self._restart(world)
            observed.append(rows_seen)
        ended = over | late
        infos = {"final_obs": final, "_final_obs": ended} if ended.any() else {}
        return np.concatenate(observed), rewards, over, late, infos

    def render(self) -> tuple[NDArray[np.uint8], ...]:
        """Return a picture of each world, height x width x 3."""
        return tuple(world.render() for world in self._worlds)

    def close_extras(self, **_: Any) -> None:
        """Close all worlds."""
        for world in self._worlds:
            world.close()

    def _restart(self, world: ArenaEnv) -> Vector:
        """Start the next trial in a world; return its observations, robots x numbers."""
        self._next_seed += 1
        seen, _ = world.reset(seed=self._next_seed - 1)
        return np.stack([seen[agent] for agent in world.agents])
