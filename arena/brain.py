"""What moves a robot: `Brain`, and the one that is a few lines of Python.

Once per quantum a brain sees the world as it is at the quantum's start and says how fast the wheels turn during it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

from arena import bodies
from arena.controllers import steps_per_second
from arena.scene import FCY, Scene
from arena.vision import NOTHING, OBJECT, Eye, sensor_of
from arena.world import STREAM_SENSORS, STREAM_START, Poses, generator

SPREAD_TCY: Final = 1_600_000
"""Robots are switched on within one camera frame of each other, each at its own moment."""


class Line(NamedTuple):
    """A line a robot said by Bluetooth: Tcy since the robot was switched on at its first byte."""

    cycle: int
    text: str


@dataclass(slots=True)
class Reading:
    """What can be told about a robot at a sample, beside its pose."""

    seen: int = NOTHING
    """Last answer of the line-of-sight sensor; -1 if the brain keeps it to itself."""
    load: float = 0.0
    """Share of the CPU's cycles since the last sample that were not idle."""
    leds: int = 0
    """Bit n: ring LED n; 8 front, 9 body."""
    fault: str = ""
    """Why the robot's firmware stopped; empty while it runs."""


class Brain(Protocol):
    """One robot's controller."""

    def think(self, tick: int, poses: Poses) -> tuple[float, float]:
        """Live through quantum `tick`, which begins with `poses`; wheel speeds (left, right) in cm/s during it."""

    def reading(self) -> Reading:
        """What to record; ends the period of `load`."""

    def lines(self) -> list[Line]:
        """What was said since the last call."""

    def close(self) -> None:
        """Give back processes and memory."""


def switched_on(seed: int, robot: int) -> int:
    """Tcy after the trial's start at which a robot gets power."""
    return int(generator(seed, STREAM_START, robot).integers(SPREAD_TCY))


class ScriptedBrain:
    """The clustering controller in Python, on the same sensor geometry and frame rate as the firmware's camera.

    It looks once per frame; the answer turns the wheels from the next quantum on. `lead_tcy` is the time from power-on to
    the first frame's middle.
    """

    def __init__(self, scene: Scene, seed: int, robot: int, controller: str, lead_tcy: int = 0) -> None:
        self._scene = scene
        self._robot = robot
        self._controller = controller
        self._quantum = scene.clock.quantum_tcy
        self._next_look = switched_on(seed, robot) + lead_tcy
        self._rng = generator(seed, STREAM_SENSORS, robot)
        self._missing = scene.camera.false_negative
        self._inventing = scene.camera.false_positive
        self._reading = Reading()
        self._wheels = (0.0, 0.0)

    def think(self, tick: int, poses: Poses) -> tuple[float, float]:
        """As `Brain.think`."""
        wheels = self._wheels
        if self._next_look < (tick + 1) * self._quantum:
            self._next_look += self._scene.camera.frame_tcy
            self._reading.seen = seen = self._look(poses)
            left, right = steps_per_second(self._controller, seen)
            self._wheels = left * bodies.CM_PER_STEP, right * bodies.CM_PER_STEP
        return wheels

    def _look(self, poses: Poses) -> int:
        seen = sensor_of(Eye(self._scene, poses, self._robot))
        if seen != NOTHING and self._missing and self._rng.random() < self._missing:
            return NOTHING
        if seen == NOTHING and self._inventing and self._rng.random() < self._inventing:
            return OBJECT
        return seen

    def reading(self) -> Reading:
        """As `Brain.reading`."""
        return self._reading

    def lines(self) -> list[Line]:
        """A script says nothing."""
        return []

    def close(self) -> None:
        """Nothing to give back."""


def seconds_of(tick: int, scene: Scene) -> float:
    """Start of a quantum in seconds."""
    return tick * scene.clock.quantum_tcy / FCY
