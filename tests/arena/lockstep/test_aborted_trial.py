"""Trials that an exception ends in the middle of a quantum: nothing of them stays, nothing goes on by accident."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable
from pathlib import Path
from threading import enumerate as enumerate_threads
from typing import Any

import pytest

from arena.lockstep.scheduler import LockStep
from arena.robots.firmware_controller import FirmwareController
from arena.scene.loader import load_scene
from arena.world.physics import World
from tests.arena.images import BEGIN

LOOKING = f"""{BEGIN}
1:      mov     PORTD, w0
        bra     1b
"""
FIRST_LINES = 3
"""Lines that are seen before somebody has had enough."""


def interrupted(robot: FirmwareController) -> None:
    """Let the robot's camera be interrupted after some lines."""
    camera, paint = robot.machine.board.camera, robot._pixels
    lines = 0

    def pixels(*line: Any) -> Any:
        nonlocal lines
        lines += 1
        if lines == FIRST_LINES:
            raise KeyboardInterrupt
        return paint(*line)

    camera.sample(pixels)


@pytest.mark.parametrize("is_native", [True, False])
def test_a_swarm_that_was_interrupted_is_let_go(assembled: Callable[[str], Path], is_native: bool) -> None:
    """Others wait for poses or are to be run: their machines, the world and the threads go with the swarm."""
    before = set(enumerate_threads())
    scene = load_scene("clustering").with_values(robots__count=3)
    robots = [FirmwareController(scene, 1, i, assembled(LOOKING), 0) for i in range(3)]
    interrupted(robots[1])
    lockstep = LockStep(World(scene, 1), robots, is_native=is_native, threads=3)
    with pytest.raises(KeyboardInterrupt):
        lockstep.advance(300)
    with pytest.raises(RuntimeError, match="begin another trial"):
        lockstep.advance(300)
    kept = [weakref.ref(thing) for thing in (lockstep, *robots, *(robot.machine for robot in robots))]
    helpers = set(enumerate_threads()) - before
    assert len(helpers) == 2
    del lockstep, robots
    gc.collect()
    assert not any(one() is not None for one in kept)
    for helper in helpers:
        helper.join(10)
        assert not helper.is_alive()


def test_a_machine_that_was_interrupted_has_no_limits_of_another_run(assembled: Callable[[str], Path]) -> None:
    scene = load_scene("clustering").with_values(robots__count=1)
    robot = FirmwareController(scene, 1, 0, assembled(LOOKING), 0)
    interrupted(robot)
    with pytest.raises(KeyboardInterrupt):
        LockStep(World(scene, 1), [robot]).advance(300)
    machine = robot.machine
    machine.board.camera.sample(None)
    before = machine.cycle
    assert before < machine.cycles_in(0.3)
    assert machine.run(cycles=1000).reason == "limit"
    assert before + 1000 <= machine.cycle < before + 1064
