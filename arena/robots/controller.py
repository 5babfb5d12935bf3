"""What moves a robot: `Brain`, and the one that is a few lines of Python.

Once per quantum a brain sees the world as it is at the quantum's start and says how fast the wheels turn during it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

from arena.camera.appearance import NOTHING, OBJECT
from arena.camera.renderer import Sight
from arena.robots.reactive import steps_per_second
from arena.scene import dimensions
from arena.scene.loader import FCY, Scene
from arena.world.physics import STREAM_SENSORS, STREAM_START, Poses, generator, traits_of

LATENCY_TCY: Final = 258_484
"""From the middle of the window's rows to the new wheel speed, 17.5 ms, and"""
FIRST_LOOK_TCY: Final = 853_232
"""from power-on to the first such row: both as the `clustering` firmware does it, which reads the region to its end
(16.4 ms) before it answers. tests/arena/test_emulated.py measures both. Published trials were run with these numbers,
so they stay; the firmware looks at 855,484, 0.15 ms later, since its camera has a register's value with the last bit.
"""
OK_DECODED_TCY: Final = 354_275
"""From there until the `clustering` firmware has understood it, 24.0 ms; the bare one needs 345,804."""
NEVER: Final = 1 << 62
STRIP_COLUMNS: Final = range(240, 400)
STRIP_PIXELS: Final = 20
"""Recorded strips of the camera's picture: the region the clustering firmware reads, 160 columns of the 640 in 20
pixels (openswarm-original.md §8)."""


class Line(NamedTuple):
    """A line a robot said by Bluetooth: Tcy since the trial's start at its first byte."""

    cycle: int
    text: str


class Lights(NamedTuple):
    """A robot's LEDs changed: Tcy since the trial's start; bit n: ring LED n, 8 front, 9 body."""

    cycle: int
    leds: int


@dataclass(slots=True)
class Reading:
    """What can be told about a robot at a sample, beside its pose."""

    seen: int = NOTHING
    """Last answer of the line-of-sight sensor; -1 if the brain keeps it to itself."""
    load: float = 0.0
    """Share of the CPU's cycles since the last sample that were not idle."""
    leds: int = 0
    """Bit n: ring LED n; 8 front, 9 body."""
    strip: bytes = b""
    """Red, green, blue of at most STRIP_PIXELS pixels in STRIP_COLUMNS, left to right, of the last line near the middle
    of the picture that the firmware read: with noise, before the sensor's gains. Empty if it read none."""
    infrared: list[int] | None = None
    """Counts by which the own emitters lower the eight infrared sensors; None if the firmware never converted one."""
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

    def lights(self) -> list[Lights]:
        """Changes of the LEDs since the last call."""

    def tell(self, data: bytes) -> None:
        """What a host or another robot sends it by Bluetooth."""

    def spoken(self) -> bytes:
        """What it wrote to UART1 since the last call; kept from the first call on."""

    def close(self) -> None:
        """Give back processes and memory."""


def switched_on(scene: Scene, seed: int, robot: int) -> int:
    """Tcy after the trial's start at which a robot gets power."""
    return int(generator(seed, STREAM_START, robot).integers(scene.start.spread_tcy))


def told_at(scene: Scene) -> int:
    """Tcy after the trial's start at which somebody presses the remote control's key (experiment.md §4)."""
    return round(scene.start.remote_at_s * FCY)


class ScriptedBrain:
    """The clustering controller in Python, on the same sensor geometry and frame rate as the firmware's camera.

    It looks once per frame, at the pose extrapolated to that cycle; `LATENCY_TCY` later the wheels turn accordingly.
    Both happen at their own cycle within a quantum. `FIRST_LOOK_TCY` after power-on comes the first look; it stands
    still until the remote control's key is understood.
    """

    def __init__(self, scene: Scene, seed: int, robot: int, controller: str) -> None:
        self._scene = scene
        self._robot = robot
        self._controller = controller
        self._quantum = scene.clock.quantum_tcy
        self._next_look = switched_on(scene, seed, robot) + FIRST_LOOK_TCY
        self._goes_at = told_at(scene) + OK_DECODED_TCY if scene.start_of(robot).remote else 0
        self._sight = Sight(scene, robot, traits_of(scene, seed, robot))
        self._rng = generator(seed, STREAM_SENSORS, robot)
        self._missing = scene.camera.false_negative
        self._inventing = scene.camera.false_positive
        self._reading = Reading()
        self._off_tick = scene.off_tick(robot)
        self._wheels = self._wanted = (0.0, 0.0)
        self._change_at = NEVER
        self._before: Poses | None = None

    def think(self, tick: int, poses: Poses) -> tuple[float, float]:
        """As `Brain.think`. A change in the middle of the quantum counts with its share."""
        if tick >= self._off_tick:
            self._reading = Reading()
            return 0.0, 0.0
        start = tick * self._quantum
        end = start + self._quantum
        if self._next_look < end:
            self._sight.look(poses, self._before, max(self._next_look - start, 0) / self._quantum)
            self._reading.seen = seen = self._sensed()
            if self._next_look + LATENCY_TCY >= self._goes_at:
                left, right = steps_per_second(self._controller, seen)
                self._wanted = left * dimensions.CM_PER_STEP, right * dimensions.CM_PER_STEP
                self._change_at = self._next_look + LATENCY_TCY
            self._next_look += self._scene.camera.frame_tcy
        self._before = poses
        if self._change_at >= end:
            return self._wheels
        old, new = self._wheels, self._wanted
        share = min((end - self._change_at) / self._quantum, 1.0)
        self._wheels, self._change_at = new, NEVER
        return old[0] + share * (new[0] - old[0]), old[1] + share * (new[1] - old[1])

    def _sensed(self) -> int:
        seen = self._sight.sensor()
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

    def lights(self) -> list[Lights]:
        """A script has no LEDs."""
        return []

    def tell(self, data: bytes) -> None:
        """A script does not listen."""

    def spoken(self) -> bytes:
        """A script says nothing."""
        return b""

    def close(self) -> None:
        """Nothing to give back."""
