"""The count of a timer (§7), computed from the cycle, the clock source and a few record cells.

The stored TMR value is the count at cycle `base`; one count takes `tick` Tcy.
"""

from __future__ import annotations

from typing import Final

from emu.chips.chip import TimerSite
from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.pins import parse_pin
from emu.peripherals.timers.arithmetic import PRESCALE, advance, counts_until
from emu.peripherals.timers.rules import PIN, TCY, WAVEFORM
from emu.system.events import NEVER


class Counter(Peripheral):
    """TMR, PR and TxCON, and the computation of the count. It is 32 bits wide with T32 set and a type C partner."""

    def __init__(self, site: TimerSite, context: ChipContext) -> None:
        super().__init__(f"t{site.number}", context)
        self.site: Final = site
        self.tmr: Final = self.register(f"TMR{site.number}")
        self.pr: Final = self.register(f"PR{site.number}")
        self.con: Final = self.register(f"T{site.number}CON")
        self.idle_bit = (self.con, "TSIDL")
        self.lower: Counter | None = None
        """For a type C timer, the type B timer that uses it while T32 is set."""
        self.upper: Counter | None = None
        self.base: Final = self.timestamp("base")
        """Cycle at which the count equals the stored TMR value. If the source is Tcy, the prescaler is empty then."""
        self.tick: Final = self.cell("tick")
        """Tcy per count; 0 while the timer is stopped or externally clocked."""
        self._source: Final = self.cell("source", "B")
        self._phase: Final = self.cell("phase", "H")
        self._before: Final = self.cell("before", "I")
        self._port, self._pin = parse_pin(site.clock_pin) if site.clock_pin else (0, 0)

    @property
    def is_wide(self) -> bool:
        """Whether this timer and its partner form a 32-bit timer."""
        return self.upper is not None and bool(self.con["T32"])

    @property
    def is_upper_half(self) -> bool:
        """Whether this timer is the upper half of a 32-bit timer."""
        return self.lower is not None and self.lower.is_wide

    @property
    def _start(self) -> int:
        return self.tmr.value | (self.upper.tmr.value << 16 if self.upper is not None and self.is_wide else 0)

    @_start.setter
    def _start(self, count: int) -> None:
        self.tmr.value = count
        if self.upper is not None and self.is_wide:
            self.upper.tmr.value = count >> 16

    @property
    def limit(self) -> int:
        """Period: the value of PR, 32 bits wide in 32-bit mode."""
        return self.pr.value | (self.upper.pr.value << 16 if self.upper is not None and self.is_wide else 0)

    @property
    def top(self) -> int:
        """Maximum count: 0xFFFF or 0xFFFF_FFFF."""
        return 0xFFFF_FFFF if self.is_wide else 0xFFFF

    def _ticks(self, cycle: int) -> int:
        """Return the number of source clocks, before the prescaler, from `base` to `cycle`."""
        source, cycle = self._source.value, min(cycle, self._frozen.value)
        if source == TCY:
            return max(cycle - self.base.value, 0)
        if source == WAVEFORM:
            waveform = self.context.pins.waveform(self._port, self._pin)
            if waveform is not None and cycle > self.base.value:  # an edge in cycle c counts in c + 1 (§7 rule 9)
                return waveform.rises(self._pin, self.base.value - 1, cycle - 1)
        return 0

    def count(self, cycle: int) -> int:
        """Return the count at `cycle`, which must not precede the last write to the timer."""
        if self.is_upper_half:
            assert self.lower is not None
            return self.lower.count(cycle) >> 16
        if self._source.value == PIN:
            return self._before.value if cycle < self.base.value else self._start
        clocks = self._phase.value + self._ticks(cycle)
        return advance(self._start, clocks // self._prescale, self.limit, self.top)

    def read(self) -> int:
        """Return TMR as read by an instruction in the current cycle."""
        return self.count(self.clock) & 0xFFFF

    def next_cycle_at(self, target: int, after: int) -> int:
        """Return the first cycle after `after` at which the count becomes `target`, or NEVER."""
        if self.is_upper_half or self.is_frozen:
            return NEVER
        source = self._source.value
        if source == PIN:  # of the edges, only those that have already occurred are known
            arriving = after < self.base.value and self._before.value != target == self._start
            return self.base.value if arriving else NEVER
        if source not in (TCY, WAVEFORM):
            return NEVER
        done = (self._phase.value + self._ticks(after)) // self._prescale
        now = advance(self._start, done, self.limit, self.top)
        more = counts_until(now, target, self.limit, self.top)
        if more is None:
            return NEVER
        clocks = (done + more) * self._prescale - self._phase.value
        if source == TCY:
            return self.base.value + clocks
        waveform = self.context.pins.waveform(self._port, self._pin)
        edge = NEVER if waveform is None else waveform.nth_rise(self._pin, self.base.value - 1, clocks)
        return NEVER if edge == NEVER else edge + 1

    @property
    def _prescale(self) -> int:
        return PRESCALE[self.con["TCKPS"]]

    def _fold(self, cycle: int, prescale: int, limit: int) -> None:
        """Move the base to `cycle`; count up to there with the given (old) prescaler and period."""
        clocks = self._phase.value + self._ticks(cycle)
        self._start = advance(self._start, clocks // prescale, limit, self.top)
        self._phase.value = clocks % prescale
        self.base.value = cycle
