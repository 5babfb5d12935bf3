"""Trials that an exception aborts in the middle of a quantum: all objects are freed, and no thread continues."""

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
from tests.arena.robot_programs import BEGIN

LOOKING = f"""{BEGIN}
1:      mov     PORTD, w0
        bra     1b
"""
FIRST_LINES = 3
"""Number of camera lines before the exception."""


def interrupt(robot: FirmwareController) -> None:
    """Make the robot's camera raise an exception after FIRST_LINES lines."""
    camera, paint = robot.machine.board.camera, robot._pixels
    lines = 0

    def pixels(*line: Any) -> Any:
        nonlocal lines
        lines += 1
        if lines == FIRST_LINES:
            raise KeyboardInterrupt
        return paint(*line)

    camera.show_pixels(pixels)


@pytest.mark.slow
@pytest.mark.parametrize("is_native", [True, False])
def test_an_aborted_trial_is_freed(assembled: Callable[[str], Path], is_native: bool) -> None:
    """After an exception in one robot, the machines, the world and the threads are freed, although other robots wait
    for poses or are runnable."""
    before = set(enumerate_threads())
    scene = load_scene("clustering").with_values(robots__count=3)
    robots = [FirmwareController(scene, 1, i, assembled(LOOKING), 0) for i in range(3)]
    interrupt(robots[1])
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


def test_an_interrupted_machine_keeps_no_limits(assembled: Callable[[str], Path]) -> None:
    scene = load_scene("clustering").with_values(robots__count=1)
    robot = FirmwareController(scene, 1, 0, assembled(LOOKING), 0)
    interrupt(robot)
    with pytest.raises(KeyboardInterrupt):
        LockStep(World(scene, 1), [robot]).advance(300)
    machine = robot.machine
    machine.board.camera.show_pixels(None)
    before = machine.cycle
    assert before < machine.cycles_in(0.3)
    assert machine.run(cycles=1000).reason == "limit"
    assert before + 1000 <= machine.cycle < before + 1064
