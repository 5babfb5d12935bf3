"""Input capture 1-8 (§8): stores the count of timer 2 or 3 at edges of a pin, in a FIFO of four values."""

from __future__ import annotations

from typing import Final

from emu.chips.chip import CaptureSite
from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.timers.timers import Timer
from emu.system.events import NEVER

_FIFO: Final = 4
_LATENCY: Final = 2  # UNVERIFIED: Tcy from the edge to the capture (§8)

_OFF, _EVERY_EDGE, _FALLING, _RISING, _FOURTH, _SIXTEENTH, _UNUSED, _WAKE = range(8)
"""Values of ICM, the capture mode (§8)."""
_DIVIDE: Final = {_FOURTH: 4, _SIXTEENTH: 16}


class Capture(Peripheral):
    """One input capture channel."""

    def __init__(
        self, site: CaptureSite, context: ChipContext, interrupts: Interrupts, timers: dict[int, Timer]
    ) -> None:
        super().__init__(f"ic{site.number}", context)
        self._line: Final = interrupts.line(site.irq)
        self._timers: Final = timers
        self.buf: Final = self.register(f"IC{site.number}BUF")
        self.con: Final = self.register(f"IC{site.number}CON")
        self.idle_bit = (self.con, "ICSIDL")
        self.buf.read_by(self._read)
        self.buf.computed(lambda: self._fifo[0])
        self.con.written_by(self._con_written)
        self._fifo: Final = self.array("fifo", "H", _FIFO)
        self._count: Final = self.cell("count", "B")
        self._edges: Final = self.cell("edges", "B")
        """Number of rising edges counted by the prescaler."""
        self._captures: Final = self.cell("captures", "B")
        """Number of captures since the last interrupt."""
        self._second: Final = self.timestamp("second", NEVER)
        """Cycle of a second capture while the first is still pending, else NEVER."""
        self._capture: Final = self.slot("capture", self._due)
        self.autobaud = False
        """Whether the UART's receive pin is connected instead of the channel's own pin."""
        context.pins.watch(site.pin, lambda cycle, changed, levels: self._own_edge(cycle, bool(levels & changed)))

    def _own_edge(self, cycle: int, rising: bool) -> None:
        if not self.autobaud:
            self.edge(cycle, rising)

    def edge(self, cycle: int, rising: bool) -> None:
        """Handle an edge of the channel's pin at `cycle`."""
        mode = self.con["ICM"]
        if mode == _WAKE and rising and self.context.power_mode():
            self._line.request()
        if self.is_frozen or not self._captures_edge(mode, rising):
            return
        if self.events.due(self._capture) == NEVER:
            self.events.set(self._capture, cycle + _LATENCY)
        else:
            self._second.value = cycle + _LATENCY

    def _captures_edge(self, mode: int, rising: bool) -> bool:
        if mode in _DIVIDE and rising:
            self._edges.value = (self._edges.value + 1) % _DIVIDE[mode]
            return self._edges.value == 0
        return mode == _EVERY_EDGE or (mode == _RISING and rising) or (mode == _FALLING and not rising)

    def _due(self, due: int) -> None:
        if self._second.value != NEVER:
            self.events.set(self._capture, self._second.value)
            self._second.value = NEVER
        if self.con["ICOV"]:
            return  # no capture until software has emptied the FIFO (§8)
        every = self.con["ICM"] == _EVERY_EDGE
        if self._count.value == _FIFO:
            if not every:  # UNVERIFIED: in mode 1, a value is lost without a flag if the FIFO is full
                self.con["ICOV"] = 1
                return
        else:
            timer = self._timers[2 if self.con["ICTMR"] else 3]
            self._fifo[self._count.value] = timer.count(due) & 0xFFFF
            self._count.value += 1
            self.con["ICBNE"] = 1
        self._captures.value += 1
        if every or self._captures.value > self.con["ICI"]:
            self._captures.value = 0
            self._line.request()

    def _read(self) -> int:
        """Read ICxBUF, which removes an entry from the FIFO. UNVERIFIED: an empty FIFO returns the last value again."""
        value = self._fifo[0]
        count = self._count.value
        if count:
            for index in range(count - 1):
                self._fifo[index] = self._fifo[index + 1]
            self._count.value = count - 1
            if count == 1:
                self.con["ICBNE"] = self.con["ICOV"] = 0
        return value

    def _con_written(self, old: int, new: int, _lanes: int) -> None:
        mode = (1 << self.context.chip.sfrs[self.con.name].fields["ICM"][1]) - 1
        if new & mode == _OFF:
            self.power_up(power_on=False)
            self.con["ICBNE"] = self.con["ICOV"] = 0
        elif (old ^ new) & mode:
            self._edges.value = 0

    def reset(self, power_on: bool) -> None:
        """Reset: empty the FIFO."""
        self._count.value = self._edges.value = self._captures.value = 0
        self._second.value = NEVER
