"""Quadrature encoder interface (DS70135G §14): position counter, index pulse, digital filter, 16-bit timer mode.

UNVERIFIED: without the filter an edge counts in its own cycle; the filter delays an edge by three of its clocks; IMV is
compared with both phases in x2 mode, too.
"""

from __future__ import annotations

from typing import Final

from emu.chips.chip import QeiSite
from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.pins import parse_pin
from emu.system.events import NEVER

_OFF, _TIMER = 0, 1
"""Values of QEIM: off, 16-bit timer. 4 to 7 are the encoder modes: bit 1 selects x4, bit 0 reset by MAXCNT (§14.3)."""
_ENCODER, _X4, _BY_MATCH = 4, 2, 1
_TIMER_PRESCALE: Final = (1, 8, 64, 256)
"""Tcy per count of the timer, by TQCKPS."""
_FILTER_DIVIDER: Final = (1, 2, 4, 16, 32, 64, 128, 256)
"""Tcy per clock of the digital filter, by QECK (§14.4)."""
_FILTER_CLOCKS: Final = 3
"""Number of filter clocks for which an input must be stable (§14.4)."""
_ROUND: Final = (0b00, 0b01, 0b11, 0b10)
"""States (B, A) of the encoder in the order of forward rotation: A leads B."""


class Qei(Peripheral):
    """The QEI module."""

    def __init__(self, site: QeiSite, context: ChipContext, interrupts: Interrupts) -> None:
        super().__init__("qei", context)
        self._line: Final = interrupts.line(site.irq)
        self.con, self.filter = self.register("QEICON"), self.register("DFLTCON")
        self.position, self.maximum = self.register("POSCNT"), self.register("MAXCNT")
        self.idle_bit = (self.con, "QEISIDL")
        self.con.written_by(self._con_written)
        self.con.computed(self._shown_con)
        self.position.written_by(lambda _old, _new, _lanes: self._restart())
        self.position.computed(lambda: self._count(self.now))
        self.maximum.written_by(lambda _old, _new, _lanes: self._plan())
        self._inputs: Final = tuple(parse_pin(name) for name in (site.a_pin, site.b_pin, site.index_pin))
        self._seen: Final = self.cell("seen", "B")
        """Filtered levels: A in bit 0, B in bit 1, the index in bit 2."""
        self._began: Final = self.timestamp("began")
        """Timer mode: cycle in which POSCNT had the value in the register."""
        self._settled: Final = self.slot("settled", lambda due: self._take_levels())
        self._match: Final = self.slot("match", self._matched)
        for port in {port for port, _ in self._inputs}:
            mask = sum(pin for one, pin in self._inputs if one == port)
            context.pins.watch_port(port, mask, lambda _cycle, _changed, _levels: self._edge(), inputs_only=True)

    # -- inputs ------------------------------------------------------------------------------------------------------

    def _levels(self) -> int:
        pins, levels = self.context.pins, 0
        for bit, (port, pin) in enumerate(self._inputs):
            levels |= bool(pins.level[port] & pin) << bit
        if self.con["SWPAB"]:
            levels = levels & 4 | (levels & 1) << 1 | levels >> 1 & 1
        return levels

    def _edge(self) -> None:
        """Handle an edge of an input: at once, or once it has been stable for three clocks of the filter."""
        if self.is_frozen:
            return
        if self.filter["QEOUT"]:
            delay = _FILTER_CLOCKS * _FILTER_DIVIDER[self.filter["QECK"]]
            self.events.set(self._settled, self.events.now + delay)
        else:
            self._take_levels()

    def _take_levels(self) -> None:
        """Take the present levels as the filtered ones; count the edge and handle an index pulse between both."""
        old, new = self._seen.value, self._levels()
        self._seen.value = new
        mode = self.con["QEIM"]
        if not mode & _ENCODER or old == new:
            return
        step = (_ROUND.index(new & 3) - _ROUND.index(old & 3)) % 4
        counts = step in (1, 3) and bool(mode & _X4 or (old ^ new) & 1)
        if step in (1, 3):
            self.con["UPDN"] = step == 1
        if counts:
            self._step(1 if step == 1 else -1, mode)
        at_match = new & 4 and new & 3 == self.filter["IMV"]
        if at_match and not (old & 4 and old & 3 == self.filter["IMV"]):
            self._index_pulse(mode)

    def _step(self, direction: int, mode: int) -> None:
        """Count one edge of the encoder (§14.2)."""
        position, last = self.position.value, self.maximum.value
        if mode & _BY_MATCH:
            if position == (last if direction > 0 else 0):
                self.position.value = 0 if direction > 0 else last
                self._line.request()
            else:
                self.position.value = position + direction & 0xFFFF
            return
        self.position.value = position + direction & 0xFFFF
        if self.position.value == (last + 1 & 0xFFFF if direction > 0 else 0xFFFF):
            self.con["CNTERR"] = 1
            if not self.filter["CEID"]:
                self._line.request()

    def _index_pulse(self, mode: int) -> None:
        """Handle an index pulse: reset the counter if POSRES is set, and request the interrupt (§14.2)."""
        if mode & _BY_MATCH:
            return
        if self.con["POSRES"]:
            self.position.value = 0 if self.con["UPDN"] else self.maximum.value
        self._line.request()

    # -- timer mode --------------------------------------------------------------------------------------------------

    @property
    def _is_timer(self) -> bool:
        return self.con["QEIM"] == _TIMER and not self.con["TQCS"]

    def _count(self, cycle: int) -> int:
        """Return POSCNT at `cycle`. The timer counts up to MAXCNT, or with UPDN = 0 down from it."""
        start = self.position.value
        if not self._is_timer:
            return start
        ticks = max(min(cycle, self.clock) - self._began.value, 0) // _TIMER_PRESCALE[self.con["TQCKPS"]]
        length, up = self.maximum.value + 1, self.con["UPDN"]
        return (start + ticks) % length if up else (start - ticks) % length

    def _plan(self) -> None:
        """Post the timer's next match: the cycle after the last count before the counter starts again."""
        if not self._is_timer or self.is_frozen:
            self.events.cancel(self._match)
            return
        tick, last = _TIMER_PRESCALE[self.con["TQCKPS"]], self.maximum.value
        now = max(self.now, self._began.value)
        count = self._count(now)
        left = (last - count if self.con["UPDN"] else count) % (last + 1) + 1
        in_tick = (now - self._began.value) % tick
        self.events.set(self._match, now - in_tick + left * tick)

    def _matched(self, due: int) -> None:
        self._line.request()
        self._plan()

    # -- control -----------------------------------------------------------------------------------------------------

    def _shown_con(self) -> int:
        """Return QEICON with INDX, the level of the index pin."""
        self.con["INDX"] = self._levels() >> 2
        return self.con.value

    def _con_written(self, old: int, new: int, _lanes: int) -> None:
        mode = self.con["QEIM"]
        if mode == _TIMER and (self.con["TQCS"] or self.con["TQGATE"]):
            self.bus.report_unmodelled("QEICON.TQCS and TQGATE: the timer counts Tcy only")
        if mode & _ENCODER:  # UPDN is a status bit in the encoder modes (§14.1)
            updn = 1 << self.context.chip.sfrs["QEICON"].fields["UPDN"][0]
            self.con.value = new & ~updn | old & updn
        self.con.value, kept = old, self.con.value
        count = self._count(self.now + 1)
        self.con.value = kept
        self.position.value = count
        self._seen.value = self._levels()
        self._restart()

    def _restart(self) -> None:
        """Let the timer count from the value in POSCNT, from the next cycle on."""
        self._began.value = self.now + 1
        self._plan()

    def reset(self, power_on: bool) -> None:
        """Reset to off."""
        self._seen.value = self._levels()
        self._began.value = self.now

    def thaw(self, cycle: int) -> None:
        """Resume the clock. Edges during the stop are lost."""
        super().thaw(cycle)
        self._seen.value = self._levels()
        if self.events.due(self._match) == NEVER:
            self._plan()
