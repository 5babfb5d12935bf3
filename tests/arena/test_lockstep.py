"""Demand lock-step: what is recorded cannot tell it from quantum after quantum."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from arena.brain import Brain, Lights, Line, Reading
from arena.emulated import EmulatedBrain
from arena.ether import Ether
from arena.lockstep import LockStep
from arena.scene import Scene, load_scene
from arena.trial import run_trial
from arena.world import Poses, World


class Stepwise:
    """A robot that is told the poses of every quantum: it cannot run ahead."""

    def __init__(self, brain: EmulatedBrain) -> None:
        self._brain = brain

    def think(self, tick: int, poses: Poses) -> tuple[float, float]:
        return self._brain.think(tick, poses)

    def reading(self) -> Reading:
        return self._brain.reading()

    def lines(self) -> list[Line]:
        return self._brain.lines()

    def lights(self) -> list[Lights]:
        return self._brain.lights()

    def tell(self, data: bytes) -> None:
        self._brain.tell(data)

    def close(self) -> None:
        self._brain.close()


def trial(scene: Scene, seed: int, image: Path, selector: int, seconds: float, ahead: bool) -> dict[str, list[Any]]:
    ether = Ether(scene.robots.count, scene.clock.quantum_tcy)
    robots = [EmulatedBrain(scene, seed, i, image, selector, ether) for i in range(scene.robots.count)]
    brains: list[Brain] = list(robots) if ahead else [Stepwise(robot) for robot in robots]
    result = run_trial(scene, seed, brains, seconds, ether=ether)
    return result.rows.columns | {"faults": result.faults}


@pytest.mark.parametrize(("image", "seed", "selector"), [
    ("clustering_image", 3, 0), ("clustering_image", 4, 1), ("talking_image", 5, 0),
])  # fmt: skip
def test_records_are_those_of_quantum_after_quantum(
    image: str, seed: int, selector: int, request: pytest.FixtureRequest
) -> None:
    """Cameras of three robots that stand about each other; one that talks and measures by infrared."""
    scene = load_scene("clustering").with_values(robots__count=3, objects__count=8)
    path = request.getfixturevalue(image)
    ahead, stepwise = (trial(scene, seed, path, selector, 2.0, how) for how in (True, False))
    assert ahead == stepwise
    assert image != "clustering_image" or any(ahead["r0_left"])


def test_robots_do_run_ahead(clustering_image: Path) -> None:
    """Otherwise the comparison above compares nothing: one robot is far in front of the world when it first looks."""
    scene = load_scene("clustering").with_values(robots__count=2)
    robots = [EmulatedBrain(scene, 1, i, clustering_image, 8) for i in range(2)]
    world = World(scene, 1)
    gaps: list[int] = []
    lockstep = LockStep(world, robots)

    def look_at(tick: int) -> tuple[Poses, Poses]:
        gaps.append(tick - world.ticks)
        return lockstep.look_at(tick)

    for robot in robots:
        robot.join(look_at)
    lockstep.advance(400)
    assert world.ticks == 400
    assert max(gaps) > 20
