"""Swarm of Kilobots: ATmega328Ps in simavr, in lock step, that receive each other's infrared pulses.

    with Kilobots([Robot(image, x=0, number=1), Robot(image, x=50, number=2)]) as swarm:
        swarm.run(2.0)
        swarm.robots[0].uart()

The same robots, seeds and calls give the same run, cycle by cycle.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from emu.boards.kilobot.swarm import (
    CALIBRATED_MM,
    FULL_SCALE,
    HIGH_GAIN_AT,
    HIGH_GAIN_MM,
    LOSS_ONE,
    LOW_GAIN_AT,
    LOW_GAIN_MM,
    NUMBER_AT,
    REACH_MM,
    counts,
)
from firmware.tools.simulated.kilobot import HZ, Kilobot, library
from firmware.tools.simulated.machine import Stopped


@dataclass(frozen=True)
class Robot:
    """Configuration of one robot at power-on."""

    image: Path
    x: float = 0.0
    """Position of its centre in mm."""
    y: float = 0.0
    number: int | None = None
    """Its UID; None: an erased EEPROM, so that the robot draws a number."""
    on_at: float = 0.0
    """Power-on time in seconds."""
    calibrated: bool = True
    """Whether its EEPROM has the tables of strength by distance."""


class Kilobots:
    """A paused swarm. Raises NotInstalled, Stopped, ValueError.

    `loss` is the share of pulses, 0 to 1, that a receiver misses. Each robot sees its own light, too."""

    def __init__(self, robots: Sequence[Robot], *, seed: int = 1, loss: float = 0.0) -> None:
        if not 0 <= loss < 1:
            raise ValueError(f"a loss of {loss} is not within 0 and 1")
        self._library = library()
        self._air = self._library.air_open(seed)
        self._loss = int(loss * LOSS_ONE)
        self.robots: list[Kilobot] = []
        self.places = [(robot.x, robot.y) for robot in robots]
        self.now = 0
        """Cycles since time 0."""
        try:
            for robot in robots:
                self._add(robot)
        except BaseException:
            self.close()
            raise
        for index in range(len(robots)):
            self._update_links(index)

    def _add(self, robot: Robot) -> None:
        machine = Kilobot(robot.image)
        self.robots.append(machine)
        if robot.number is not None:
            machine.write_eeprom(NUMBER_AT, struct.pack("<H", robot.number))
        if robot.calibrated:
            for address, gain in ((LOW_GAIN_AT, LOW_GAIN_MM), (HIGH_GAIN_AT, HIGH_GAIN_MM)):
                table = [counts(gain, distance) for distance in CALIBRATED_MM]
                machine.write_eeprom(address, struct.pack(f">{len(table)}H", *table))
        if self._library.air_join(self._air, machine.handle, int(robot.on_at * HZ)) < 0:
            raise ValueError(f"{len(self.robots)} robots are too many")

    def _update_links(self, moved: int) -> None:
        for other in range(len(self.robots)):
            distance = math.dist(self.places[moved], self.places[other])
            heard = distance <= REACH_MM
            seen = [counts(gain, distance) if heard else 0 for gain in (HIGH_GAIN_MM, LOW_GAIN_MM)]
            for way in ((moved, other), (other, moved)):
                self._library.air_link(self._air, *way, *seen, self._loss)

    def move(self, robot: int, x: float, y: float) -> None:
        """Move a robot to a position in mm, at once."""
        self.places[robot] = (x, y)
        self._update_links(robot)

    def flash(self, robot: int, after_us: float) -> None:
        """Inject a noise pulse into one robot after some us."""
        self._library.air_flash(self._air, robot, int(after_us * HZ / 1e6), FULL_SCALE, FULL_SCALE)

    def run(self, seconds: float) -> None:
        """Run all robots for a time. Raises Stopped."""
        self.now += int(seconds * HZ)
        stopped = self._library.air_run(self._air, self.now)
        if stopped >= 0:
            machine = self.robots[stopped]
            raise Stopped(f"robot {stopped} stopped at {machine.pc:#x}, its cycle {machine.now}")

    def close(self) -> None:
        """End the simulators."""
        for machine in self.robots:
            machine.close()
        if self._air:
            self._library.air_close(self._air)
            self._air = None

    def __enter__(self) -> Kilobots:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
