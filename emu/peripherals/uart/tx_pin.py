"""A UART's transmit pin: its level as a function of the cycle, its edges for a log."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.peripherals.pins import Pins
from emu.system.events import NEVER


class TxPin:
    """A `Waveform` over the one pin; `level(cycle)` is the transmitter's."""

    def __init__(self, pins: Pins, port: int, mask: int, level: Callable[[int], int]) -> None:
        self._pins: Final = pins
        self._port: Final = port
        self._mask: Final = mask
        self._level: Final = level

    def bits(self, cycle: int) -> int:
        """The pin in `cycle`."""
        return self._mask if self._level(cycle) else 0

    def rises(self, mask: int, after: int, until: int) -> int:
        """Edges of TX clock nothing inside the chip."""
        return 0

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        """Edges of TX clock nothing inside the chip."""
        return NEVER

    def constant_until(self, cycle: int) -> int:
        """Firmware does not read its own TX pin often: nothing is promised."""
        return cycle

    def log_frame(self, start: int, bits: int, length: int, bit: int) -> None:
        """Write a frame's edges to the log of the pins, if one is kept: `length` levels of `bit` Tcy from `start`."""
        if self._pins.frames is not None:
            self._pins.frames.append((start, self._port, self._mask, bits, length, bit))
            return
        edges = self._pins.edges
        if edges is None:
            return
        others = self._pins.level[self._port] & ~self._mask
        previous = 1
        for index in range(length):
            level = bits >> index & 1
            if level != previous:
                edges.append((start + index * bit, self._port, others | (self._mask if level else 0)))
            previous = level
