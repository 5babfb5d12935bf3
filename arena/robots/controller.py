"""The controller interface of a robot, and the scripted controller in Python.

Once per quantum a controller takes the poses at the start of the quantum and returns the wheel speeds during it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from arena.camera.appearance import NOTHING, OBJECT
from arena.camera.line_of_sight import LineOfSight
from arena.robots.reactive import steps_per_second
from arena.scene import dimensions
from arena.scene.loader import FCY, Scene
from arena.world.physics import STREAM_SENSORS, STREAM_START, generator, traits_of
from arena.world.poses import Poses

LATENCY_TCY: Final = 258_484
"""Time in Tcy from the middle of the sensor window's rows to the new wheel speed, 17.5 ms.

The `clustering` firmware reads the picture region to its end (16.4 ms) before it answers.
"""
FIRST_FRAME_TCY: Final = 853_232
"""Time in Tcy from power-on to the first middle of the sensor window.

tests/arena/robots/test_firmware_controller.py measures this value and LATENCY_TCY on the `clustering` firmware.
The published trials used them, so they stay. The firmware is 0.15 ms later, at 855,484 Tcy, because the camera model
includes the last bit of a register's value.
"""
OK_DECODED_TCY: Final = 354_275
"""Time in Tcy from the remote control's key until `clustering` has decoded it, 24.0 ms (`clustering-bare`: 345,804)."""
NEVER: Final = 1 << 62
"""A cycle after the end of every trial."""
STRIP_COLUMNS: Final = range(240, 400)
STRIP_PIXELS: Final = 20
"""Recorded strip of the camera picture: the region that the clustering firmware reads, 160 of 640 columns in 20
pixels (openswarm-original.md §8)."""


class SerialLine(NamedTuple):
    """A line that a robot sent on UART1, or a message by infrared; `cycle` of the trial is that of its first byte, or
    of the end of the message."""

    cycle: int
    text: str


class LedChange(NamedTuple):
    """The state of a robot's LEDs after a change at `cycle` of the trial, as `Reading.leds`."""

    cycle: int
    leds: int


@dataclass(slots=True)
class Reading:
    """Values of one robot in a sample of the record, in addition to its pose."""

    seen: int = NOTHING
    """Last answer of the line-of-sight sensor; -1 if the controller does not publish it."""
    load: float = 0.0
    """Share of the CPU's cycles since the last sample that were not idle."""
    leds: int = 0
    """LEDs of an e-puck: bit n is ring LED n, bit 8 the front LED, bit 9 the body LED. Of a Kilobot the colour of its
    LED: red + 4 green + 16 blue, each 0 to 3."""
    strip: bytes = b""
    """Red, green, blue of at most STRIP_PIXELS pixels in STRIP_COLUMNS, left to right, of the last line near the middle
    of the picture that the firmware read: with noise, before the sensor's gains. Empty if it read none."""
    infrared: list[int] | None = None
    """Counts by which the own emitters lower the eight infrared sensors; None if the firmware never converted one."""
    fault: str = ""
    """Why the robot's firmware stopped; empty while it runs."""


@dataclass(frozen=True, slots=True)
class Program:
    """What a robot runs: an image, else the Python file of a controller, else the table of speeds `controller`."""

    controller: str
    image: Path | None = None
    file: Path | None = None


class Controller(Protocol):
    """The controller of one robot."""

    def control_step(self, tick: int, poses: Poses) -> tuple[float, float]:
        """Run quantum `tick`, which begins with `poses`; return the values of the drive (left, right) during it: wheel
        speeds of an e-puck in cm/s, duties of a Kilobot's motors."""

    def reading(self) -> Reading:
        """Return the values to record, and begin the next period of `load`."""

    def take_lines(self) -> list[SerialLine]:
        """Return the lines sent on UART1 since the last call."""

    def take_messages(self) -> list[SerialLine]:
        """Return the messages sent to all robots in reach since the last call."""

    def take_led_changes(self) -> list[LedChange]:
        """Return the LED changes since the last call."""

    def feed_uart(self, data: bytes) -> None:
        """Send bytes to the robot's UART1, as a host or another robot does by Bluetooth."""

    def take_uart(self) -> bytes:
        """Return the bytes sent on UART1 since the last call; they are kept from the first call on."""

    def state(self) -> bytes:
        """Return the whole state of the robot's machine; empty without one."""

    def place(self) -> str:
        """Return what the robot executes at present, as text for the debugger."""

    def close(self) -> None:
        """Release processes and memory."""


def power_on_cycle(scene: Scene, seed: int, robot: int) -> int:
    """Return the cycle of the trial at which a robot gets power."""
    return int(generator(seed, STREAM_START, robot).integers(scene.start.spread_tcy))


def remote_key_cycle(scene: Scene) -> int:
    """Return the cycle of the trial at which the remote control's key is pressed (experiment-contract.md §4)."""
    return round(scene.start.remote_at_s * FCY)


class ControllerWithoutUart:
    """Base of controllers in Python, which have no UART and no LEDs."""

    def take_lines(self) -> list[SerialLine]:
        """Return no lines: this controller has no UART."""
        return []

    def take_messages(self) -> list[SerialLine]:
        """Return no messages: this controller sends none."""
        return []

    def take_led_changes(self) -> list[LedChange]:
        """Return no changes: this controller has no LEDs."""
        return []

    def feed_uart(self, data: bytes) -> None:
        """Ignore the bytes: this controller has no UART."""

    def take_uart(self) -> bytes:
        """Return no bytes: this controller has no UART."""
        return b""

    def state(self) -> bytes:
        """Return no bytes: this controller has no machine."""
        return b""

    def place(self) -> str:
        """As `Controller.place`."""
        return "a script"

    def close(self) -> None:
        """Do nothing: there is nothing to release."""


class ScriptedController(ControllerWithoutUart):
    """The clustering controller in Python, with the sensor geometry and the frame rate of the firmware's camera.

    It senses once per frame, at the pose extrapolated to that cycle. `LATENCY_TCY` later the wheels turn accordingly.
    Both happen at a cycle within a quantum. The first frame comes `FIRST_FRAME_TCY` after power-on. The robot stays at
    rest until it has decoded the remote control's key.
    """

    def __init__(self, scene: Scene, seed: int, robot: int, controller: str) -> None:
        self._scene = scene
        self._robot = robot
        self._table = controller
        self._quantum = scene.clock.quantum_tcy
        self._next_frame = power_on_cycle(scene, seed, robot) + FIRST_FRAME_TCY
        self._starts_at = remote_key_cycle(scene) + OK_DECODED_TCY if scene.start_of(robot).remote else 0
        self._sight = LineOfSight(scene, robot, traits_of(scene, seed, robot))
        self._rng = generator(seed, STREAM_SENSORS, robot)
        self._false_negative = scene.camera.false_negative
        self._false_positive = scene.camera.false_positive
        self._reading = Reading()
        self._off_tick = scene.off_tick(robot)
        self._wheels = self._next_wheels = (0.0, 0.0)
        self._change_at = NEVER
        self._before: Poses | None = None

    def control_step(self, tick: int, poses: Poses) -> tuple[float, float]:
        """As `Controller.control_step`. If the speed changes within the quantum, return the mean of the quantum."""
        if tick >= self._off_tick:
            self._reading = Reading()
            return 0.0, 0.0
        start = tick * self._quantum
        end = start + self._quantum
        if self._next_frame < end:
            quanta = max(self._next_frame - start, 0) / self._quantum
            self._reading.seen = seen = self._with_errors(self._sight.look(poses, self._before, quanta))
            if self._next_frame + LATENCY_TCY >= self._starts_at:
                left, right = steps_per_second(self._table, seen)
                self._next_wheels = left * dimensions.CM_PER_STEP, right * dimensions.CM_PER_STEP
                self._change_at = self._next_frame + LATENCY_TCY
            self._next_frame += self._scene.camera.frame_tcy
        self._before = poses
        if self._change_at >= end:
            return self._wheels
        old, new = self._wheels, self._next_wheels
        share = min((end - self._change_at) / self._quantum, 1.0)
        self._wheels, self._change_at = new, NEVER
        return old[0] + share * (new[0] - old[0]), old[1] + share * (new[1] - old[1])

    def _with_errors(self, seen: int) -> int:
        """Return an answer of the line-of-sight sensor, or a false one with the scene's probability."""
        if seen != NOTHING and self._false_negative and self._rng.random() < self._false_negative:
            return NOTHING
        if seen == NOTHING and self._false_positive and self._rng.random() < self._false_positive:
            return OBJECT
        return seen

    def reading(self) -> Reading:
        """As `Controller.reading`."""
        return self._reading
