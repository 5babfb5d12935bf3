"""Log of the inputs that a robot reads from its world, so that its past can be run again without the world."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from emu.machine.machine import Machine

SENSORS: Final = range(8, 16)
"""ADC channels of the infrared sensors."""


class InputLog:
    """Camera lines and sensor levels by cycle: recorded in the first run, returned during a replay."""

    def __init__(self, machine: Machine) -> None:
        self.is_recording = True
        """Whether new inputs are logged; false once no replay can need them."""
        self._events: Final = machine.events
        self._ir: Final = machine.board.ir
        self._lines: Final[dict[int, NDArray[np.uint8]]] = {}
        self._levels: Final = _SensorLevels()
        camera, sources = machine.board.camera, machine.board.chip.adc.source
        camera.show_pixels(partial(self._pixels, camera.pixel_source))
        self._ir.emit_in_python()  # during a replay no conversion calls the native code that applies waiting edges
        for channel in SENSORS:
            sources[channel] = partial(self._level, channel, sources[channel])

    def _pixels(
        self, source: Callable[[int, NDArray[np.intp], int], NDArray[np.uint8]], y: int, columns: NDArray[np.intp],
        cycle: int,
    ) -> NDArray[np.uint8]:  # fmt: skip
        """Return the pixels of a camera line, from `source` in the present and from the log in the past."""
        if self._events.quiet:
            pixels = self._lines.get(cycle)
            return pixels if pixels is not None else np.zeros((len(columns), 3), np.uint8)  # not in the log
        pixels = source(y, columns, cycle)
        if self.is_recording:
            self._lines[cycle] = pixels
        return pixels

    def _level(self, channel: int, source: Callable[[int], int], cycle: int) -> int:
        """Return the level of a sensor, from `source` in the present and from the log in the past.

        `source` also updates the light that the board stores for all sensors; the log restores this light."""
        lights = self._ir.reflection, self._ir.ambient
        if self._events.quiet:
            found = self._levels.find(cycle, channel)
            if found is None:  # the replay has left the recorded path
                return 0
            level, light = found
            half = len(light) // 2
            for stored, logged in zip(lights, (light[:half], light[half:]), strict=True):
                stored[:] = memoryview(logged).cast("B").cast(stored.format)
            return level
        level = source(cycle)
        if self.is_recording:
            self._levels.add(cycle, channel, level, b"".join(stored.tobytes() for stored in lights))
        return level


class _SensorLevels:
    """Sensor levels by cycle and channel, each with the light around the robot: about 20 bytes per level."""

    def __init__(self) -> None:
        self._cycles: Final = array("q")
        self._channels: Final = array("B")
        self._levels: Final = array("q")
        self._light_indices: Final = array("L")
        self._lights: Final[list[bytes]] = []
        """Distinct consecutive values of the light."""

    def add(self, cycle: int, channel: int, level: int, light: bytes) -> None:
        """Append a level; discard levels of later cycles, which belong to an abandoned future."""
        while self._cycles and self._cycles[-1] > cycle:
            for column in (self._cycles, self._channels, self._levels, self._light_indices):
                column.pop()
        if not self._lights or self._lights[-1] != light:
            self._lights.append(light)
        self._cycles.append(cycle)
        self._channels.append(channel)
        self._levels.append(level)
        self._light_indices.append(len(self._lights) - 1)

    def find(self, cycle: int, channel: int) -> tuple[int, bytes] | None:
        """Return level and light of a channel in a cycle, or None if the log has none."""
        for at in range(bisect_left(self._cycles, cycle), bisect_right(self._cycles, cycle)):
            if self._channels[at] == channel:
                return self._levels[at], self._lights[self._light_indices[at]]
        return None
