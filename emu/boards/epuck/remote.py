"""Infrared remote control (epuck.md §6): RC-5 frames on RF6, which is high when idle and low during the carrier."""

from __future__ import annotations

from typing import Final

from emu.boards.part import BoardPart
from emu.peripherals import Peripherals
from emu.system.events import NEVER

PIN: Final = "RF6"
HALF_BIT_SECONDS: Final = 0.889e-3
"""Duration in s of half a Manchester bit, whose length is 1.778 ms (epuck.md §6)."""
REPEAT_SECONDS: Final = 113.8e-3
_BITS: Final = 14
_WAITING: Final = 64
"""Capacity of the frame queue, in frames."""

KEYS: Final = {"standby": 12, "swap": 34, "sleep": 42, "ok": 53}
"""RC-5 command codes that the demonstration programs use (openswarm-original.md §5.6)."""


class Remote(BoardPart):
    """The infrared remote control. Snapshots contain its frame queue and the frame that it is sending."""

    def __init__(self, chip: Peripherals) -> None:
        super().__init__("remote", chip)
        self._frame: Final = self.cell("frame", "H")
        self._start: Final = self.cell("start", "Q")
        self._half: Final = self.cell("half", "B")
        self._toggle: Final = self.cell("toggle", "B")
        self._busy_until: Final = self.cell("busy_until", "Q")
        self._edge: Final = self.slot("edge", self._next_half)
        self._at: Final = self.array("at", "Q", _WAITING)
        self._frames: Final = self.array("frames", "H", _WAITING)
        self._head: Final = self.cell("head", "H")
        self._count: Final = self.cell("count", "H")
        self.pins.set(PIN, 1)

    def press(self, command: int | str, address: int = 0, cycle: int | None = None, repeat: int = 1) -> None:
        """Queue `repeat` frames of one key press.

        `command` is 0..63 or a name of `KEYS`, `address` a device address, 0..31.

        The first frame begins at `cycle` (default: now) or after the previous frame. Raises ValueError for numbers out
        of range or more than 64 queued frames, KeyError for an unknown name.
        """
        code = KEYS[command] if isinstance(command, str) else command
        if not 0 <= code < 64 or not 0 <= address < 32:
            raise ValueError(f"RC-5 has commands 0..63 and addresses 0..31, not {code} and {address}")
        if self._count.value + repeat > _WAITING:
            raise ValueError(f"more than {_WAITING} remote control frames are queued")
        self._toggle.value ^= 1
        frame = 3 << 12 | self._toggle.value << 11 | address << 6 | code
        begin = max(self.now + 1 if cycle is None else cycle, self._busy_until.value)
        for number in range(repeat):
            tail = (self._head.value + self._count.value) % _WAITING
            self._at[tail], self._frames[tail] = begin + number * self.cycles(REPEAT_SECONDS), frame
            self._count.value += 1
        self._busy_until.value = begin + repeat * self.cycles(REPEAT_SECONDS)
        if self.events.due(self._edge) == NEVER:
            self._start_next()

    def _start_next(self) -> None:
        if self._count.value:
            head = self._head.value
            self._start.value, self._frame.value = self._at[head], self._frames[head]
            self._head.value = (head + 1) % _WAITING
            self._count.value -= 1
            self.events.set(self._edge, self._start.value)

    def _next_half(self, due: int) -> None:
        """Output one half bit. A 1 is high, then low; a 0 is low, then high. The carrier pulls the pin low."""
        half = self._half.value
        if half == 2 * _BITS:
            self.pins.set(PIN, 1, due)
            self._half.value = 0
            self._start_next()
            return
        bit = self._frame.value >> _BITS - 1 - half // 2 & 1
        self.pins.set(PIN, bit ^ half & 1, due)
        self._half.value = half + 1
        self.events.set(self._edge, self._start.value + self.cycles(HALF_BIT_SECONDS * (half + 1)))
