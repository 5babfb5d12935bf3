"""`EmulatedBrain`: the firmware itself, on an emulated e-puck, joined to the world through pins, volts and pixels.

In: poses once per quantum, pixels whenever the firmware's camera driver reads a line. Out: motor steps, LEDs, lines of
UART1 (Bluetooth). Poses are extrapolated within the quantum to the cycle in which a line is read.
"""

from __future__ import annotations

from collections import deque
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

import emu
from arena import bodies
from arena.brain import OK_AT_TCY, STRIP_COLUMNS, STRIP_PIXELS, Lights, Line, Reading, extrapolated, switched_on
from arena.ether import Ether
from arena.infrared import Ring
from arena.scene import FCY, BatterySetting, Scene
from arena.vision import COLOURS, Eye
from arena.world import STREAM_SENSORS, Poses, generator
from emu.boards.epuck.board import Epuck
from emu.boards.epuck.simple import LED_PINS, Battery

WINDOW_S: Final = 0.010
"""Motor steps are counted over at least this long to make a speed: single steps would jerk a drive of limited force."""
PROBE_TCY: Final = 147_456
"""Mean time between two looks at whether the CPU is idle, at random cycles: 10 ms, 90,000 looks in 15 minutes."""
LINE_LIMIT: Final = 200
"""Bytes after which a line without an end is taken as one."""
LIGHTS_LIMIT: Final = 100
"""Changes of the LEDs kept per sample: a firmware may dim them by switching fast."""
FULL_VOLTS: Final = 4.2
"""epuck.md §6."""
_STRIP_ROWS: Final = range(232, 249)
"""Rows of the whole picture that count as its middle."""
_COLOURS: Final = COLOURS.astype(np.int16)
_NOISE: Final = 1 << 14
"""Values of pixel noise drawn once per robot; each line of pixels starts at a random one."""


class EmulatedBrain:
    """A machine with `image` (ELF or HEX), switched on at its own moment; `selector` is the switch's position, `ether`
    what the robots of a trial share to see each other's infrared emitters.

    Raises emu.LoadError for an unusable image.
    """

    def __init__(
        self, scene: Scene, seed: int, robot: int, image: str | Path, selector: int = 0, ether: Ether | None = None
    ) -> None:
        self._scene = scene
        self._robot = robot
        self._quantum = scene.clock.quantum_tcy
        self._on_at = switched_on(seed, robot)
        self._rng = generator(seed, STREAM_SENSORS, robot)
        noise = self._rng.normal(0.0, scene.camera.pixel_noise, _NOISE + 3 * 640)
        self._noise: NDArray[np.int16] = np.rint(noise).astype(np.int16)
        self._shown: Final = [
            np.stack([_noisy(np.resize(np.roll(one, phase), len(noise)), self._noise) for one in _COLOURS])
            for phase in range(3)
        ]
        """Values of a pixel of each class with each noise; by where in the noise a red one is, modulo 3."""
        board = partial(Epuck, camera=scene.camera.sensor, selector=selector, seed=seed * 1000 + robot)
        self.machine = emu.load(image, board=board)
        self._board: Epuck = self.machine.board
        assert self._board.camera is not None
        self._board.camera.lamp = scene.light.brightness
        self._board.camera.sample(self._pixels)
        self._board.remote.press("ok", cycle=OK_AT_TCY - self._on_at)
        self.machine.uart[1].on_byte = self._byte
        ether = ether or Ether(scene.robots.count, self._quantum)
        self._ring = Ring(scene, self._board, ether, robot, self._on_at)
        self._poses = Poses([], [])
        self._pose = (0.0, 0.0, 0.0)
        self._before = self._pose
        self._start = 0
        window = max(round(WINDOW_S / (self._quantum / FCY)), 1)
        self._counts: deque[tuple[int, int]] = deque([(0, 0)], maxlen=window + 1)
        self._lights: list[Lights] = []
        self._leds = 0
        for bit, pin in enumerate(LED_PINS.values()):
            self.machine.peripherals.pins.watch(pin, partial(self._lit, 1 << bit), lazy=True)
        self._strip: tuple[NDArray[np.intp], NDArray[np.uint8]] | None = None
        self._said: list[Line] = []
        self._text = bytearray()
        self._text_at = 0
        self._busy = self._probes = 0
        self._probe_at = 1
        self._fault = ""

    # -- one quantum -------------------------------------------------------------------------------------------------

    def think(self, tick: int, poses: Poses) -> tuple[float, float]:
        """As `Brain.think`."""
        end = (tick + 1) * self._quantum - self._on_at
        if end <= 0 or self._fault:
            return 0.0, 0.0
        self._look_around(tick, poses)
        machine = self.machine
        reached = 0
        while reached < end:
            stop = machine.run_until(min(self._probe_at, end))
            if stop is not None:
                self._fault = f"{stop.reason} at {stop.pc:#08x} in cycle {stop.cycle}: {stop.detail}".rstrip(": ")
                return 0.0, 0.0
            reached = machine.cycle
            if reached >= self._probe_at:
                self._probes += 1
                self._busy += not machine.is_asleep
                self._probe_at = reached + 1 + int(self._rng.integers(2 * PROBE_TCY))
        return self._speeds()

    def _look_around(self, tick: int, poses: Poses) -> None:
        pose = poses.robots[self._robot]
        self._before = self._pose if self._poses.robots else pose
        self._poses, self._pose = poses, pose
        self._start = tick * self._quantum - self._on_at
        self._ring.move(poses)

    def _speeds(self) -> tuple[float, float]:
        left, right = self._board.motors.steps()
        self._counts.append((left, right))
        left0, right0 = self._counts[0]
        rate = bodies.CM_PER_STEP * FCY / (self._quantum * (len(self._counts) - 1))
        return (left - left0) * rate, (right - right0) * rate

    # -- what the firmware reads and says ----------------------------------------------------------------------------

    def _pixels(self, y: int, columns: NDArray[np.intp], cycle: int) -> NDArray[np.uint8]:
        pose = extrapolated(self._before, self._pose, (cycle - self._start) / self._quantum)
        eye = Eye(self._scene, self._poses, self._robot, pose)
        seen = eye.classes(y, columns)
        first, count = int(self._rng.integers(_NOISE)), len(columns)
        if self._scene.camera.vignetting:
            bright = eye.lens.vignetting(y, columns, self._scene.camera.vignetting)
            colours = np.rint(_COLOURS[seen] * bright[:, None]).astype(np.int16)
            pixels = _noisy(colours, self._noise[first : first + 3 * count].reshape(-1, 3))
        else:
            shown = self._shown[first % 3][:, first : first + 3 * count].reshape(-1, count, 3)
            pixels = shown[seen] if isinstance(seen, int) else shown[seen, np.arange(count)]
        if y in _STRIP_ROWS:
            self._strip = columns, pixels
        return pixels

    def _byte(self, byte: int, cycle: int) -> None:
        if byte in b"\r\n" or len(self._text) >= LINE_LIMIT:
            if self._text:
                self._said.append(Line(self._text_at, self._text.decode("ascii", "backslashreplace")))
            self._text.clear()
        if byte not in b"\r\n":
            if not self._text:
                self._text_at = self._on_at + cycle
            self._text.append(byte)

    def _lit(self, led: int, cycle: int, changed: int, levels: int) -> None:
        """Changes in one cycle are one."""
        self._leds = self._leds | led if levels & changed else self._leds & ~led
        if self._lights and self._lights[-1].cycle == self._on_at + cycle:
            self._lights.pop()
        if len(self._lights) < LIGHTS_LIMIT:
            self._lights.append(Lights(self._on_at + cycle, self._leds))

    # -- what is recorded --------------------------------------------------------------------------------------------

    def reading(self) -> Reading:
        """As `Brain.reading`. `load` comes from looking at the CPU at random cycles."""
        self.machine.peripherals.pins.flush()
        self._board.battery.volts = volts_after(self._scene.battery, self.machine.cycle / FCY)
        load = self._busy / self._probes if self._probes else 0.0
        self._busy = self._probes = 0
        strip = strip_of(*self._strip) if self._strip is not None else b""
        return Reading(-1, load, self._leds, strip, self._ring.readings, self._fault)

    def lines(self) -> list[Line]:
        """As `Brain.lines`."""
        said, self._said = self._said, []
        return said

    def lights(self) -> list[Lights]:
        """As `Brain.lights`."""
        changed, self._lights = self._lights, []
        return changed

    def close(self) -> None:
        """Memory goes with the object."""


def _noisy(colours: NDArray[np.int16], noise: NDArray[np.int16]) -> NDArray[np.uint8]:
    """Red, green and blue as the sensor tells them."""
    values: NDArray[np.uint8] = np.minimum(np.maximum(colours + noise, 0), 255).astype(np.uint8)
    return values


def volts_after(battery: BatterySetting, seconds: float) -> float:
    """Voltage after so long, never under 3.0 V, where the robot's own protection would end it."""
    return max(battery.volts - (FULL_VOLTS - Battery.LOW_VOLTS) * seconds / 3600 / battery.hours, 3.0)


def strip_of(columns: NDArray[np.intp], pixels: NDArray[np.uint8]) -> bytes:
    """At most STRIP_PIXELS of the pixels of a line that lie in the middle of the picture, left to right."""
    middle = np.flatnonzero((columns >= STRIP_COLUMNS.start) & (columns < STRIP_COLUMNS.stop))
    order = middle[np.argsort(columns[middle], kind="stable")]
    count = min(len(order), STRIP_PIXELS)
    return pixels[order[np.arange(count) * len(order) // max(count, 1)]].tobytes()
