"""The engine of e-pucks: a controller in Python or firmware on an emulated robot, by what the robot runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from arena.infrared.channel import OpticalChannel
from arena.robots.controller import Controller, Program, ScriptedController
from arena.scene.loader import Scene

SELECTOR: Final = {"A": 0, "B": 1}
"""Position of the robots' rotary switch for each controller that firmware has. In firmware/apps/clustering bit 0
selects controller B, and bit 3 starts the robot without the remote control."""


def controllers(
    scene: Scene, seed: int, robots: Sequence[int], programs: Sequence[Program], channel: OpticalChannel | None
) -> list[Controller]:
    """Return the controllers of some robots, each with its program. Raises emu.LoadError for an unusable image."""
    return [_controller(scene, seed, robot, one, channel) for robot, one in zip(robots, programs, strict=True)]


def _controller(scene: Scene, seed: int, robot: int, program: Program, channel: OpticalChannel | None) -> Controller:
    """Return the controller of one robot."""
    if program.file is not None:
        from arena.robots.user_controller import UserController, load_controller

        return UserController(scene, seed, robot, load_controller(program.file))
    if program.image is None:
        return ScriptedController(scene, seed, robot, program.controller)
    from arena.robots.firmware_controller import FirmwareController  # scripted trials do not load the emulator

    chosen = scene.start_of(robot).selector
    selector = SELECTOR.get(program.controller, 0) if chosen < 0 else chosen
    return FirmwareController(scene, seed, robot, program.image, selector, channel)
