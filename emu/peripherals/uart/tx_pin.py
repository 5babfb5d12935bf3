"""A UART's transmit pin: its level as a function of the cycle, and its edges for a log."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from emu.peripherals.pins import Pins
from emu.system.events import NEVER


class TxPin:
    """`Waveform` of the TX pin. `level(cycle)` returns the transmitter's level."""

    def __init__(self, pins: Pins, port: int, mask: int, level: Callable[[int], int]) -> None:
        self._pins: Final = pins
        self._port: Final = port
        self._mask: Final = mask
        self._level: Final = level

    def bits(self, cycle: int) -> int:
        """Return the pin's level at `cycle`."""
        return self._mask if self._level(cycle) else 0

    def rises(self, mask: int, after: int, until: int) -> int:
        """Report no rising edges, because no device of the chip is clocked by TX."""
        return 0

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        """Report no rising edges, because no device of the chip is clocked by TX."""
        return NEVER

    def constant_until(self, cycle: int) -> int:
        """Return `cycle` (no guarantee), because firmware rarely reads its own TX pin."""
        return cycle

    def changes(self, after: int, until: int) -> Iterable[tuple[int, int, int]]:
        """Return no edges, because `log_frame` and `log_level` log them."""
        return ()

    def log_level(self, cycle: int, level: int) -> None:
        """Append the pin's level from `cycle` on to the log of pin changes, if there is one."""
        self._pins.log_level(cycle, self._port, self._mask, self._mask if level else 0)

    def log_frame(self, start: int, bits: int, length: int, bit: int) -> None:
        """Append a frame to the log of pin changes, if there is one:

        `length` levels of `bit` Tcy each from `start` on.
        """
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
