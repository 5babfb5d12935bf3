"""Evolve the four wheel speeds of aggregation without computation in `arena.env`, and print them as firmware constants.

    python docs/examples/evolve_aggregation.py --generations 30
    make -C firmware APP=aggregation DEFINES="-DALONE=... -DAHEAD=..."       (as printed)

A (1+1) evolution strategy: a child replaces its parent if robots end nearer to each other over the same seeds. Speeds
are whole percents, as the firmware has them.
"""

from __future__ import annotations

import argparse
import json

import numpy as np
from numpy.typing import NDArray

from arena.env import SENSED, ArenaEnv
from arena.scene.loader import load_scene

ROBOT = SENSED - 1
"""Place of "a robot is ahead" in an observation."""


def dispersion(env: ArenaEnv, genome: NDArray[np.int64], seed: int) -> float:
    """Return how far the robots are spread at the end of a trial: mean distance from their centre, cm."""
    observed, _ = env.reset(seed=seed)
    while env.agents:
        actions = {agent: (genome[2:] if seen[ROBOT] else genome[:2]) / 100 for agent, seen in observed.items()}
        observed, *_ = env.step(actions)
    places = env.supervisor.robots[:, :2]
    return float(np.hypot(*(places - places.mean(axis=0)).T).mean())


def evolve(generations: int, seeds: list[int], seconds: float, seed: int) -> tuple[NDArray[np.int64], list[float]]:
    """The best genome (left, right alone; left, right with a robot ahead), and its value after each generation."""
    rng = np.random.default_rng(seed)
    scene = load_scene("aggregation").with_values(robots__wheel_noise=0.0)
    env = ArenaEnv(scene, seconds=seconds, decision_s=0.1)
    best: NDArray[np.int64] = rng.integers(-100, 101, 4)
    value = float(np.mean([dispersion(env, best, one) for one in seeds]))
    series = [value]
    for _ in range(generations):
        child = np.clip(best + np.rint(rng.normal(0, 30, 4)).astype(int), -100, 100)
        found = float(np.mean([dispersion(env, child, one) for one in seeds]))
        if found <= value:
            best, value = child, found
        series.append(value)
    return best, series


def main() -> None:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--generations", type=int, default=30)
    parser.add_argument("--seeds", type=int, default=2, help="trials a genome is tried in")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    best, series = evolve(options.generations, list(range(options.seeds)), options.seconds, options.seed)
    alone, ahead = (f"{left},{right}" for left, right in (best[:2], best[2:]))
    print(json.dumps({"spread_cm": [round(value, 1) for value in series]}))
    print(f'make -C firmware APP=aggregation DEFINES="-DALONE={alone} -DAHEAD={ahead}"')


if __name__ == "__main__":
    main()
