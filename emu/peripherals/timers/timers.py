"""Timers 1-5 (§7): timer, gated and counter modes, 32-bit pairs. TMR is computed when read, not incremented.

`counter.py` computes the count; `rules.py` has the rules for the common cases. This module handles all other register
writes, the clock sources and the match. A match posts one event. It is due in the cycle in which the interrupt flag
first reads 1: one Tcy after TMR became equal to PR (§7 rule 2).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.chips.chip import TimerSite
from emu.peripherals.base import IDLE, SLEEP, ChipContext
from emu.peripherals.timers.arithmetic import PRESCALE, advance
from emu.peripherals.timers.counter import Counter
from emu.peripherals.timers.rules import (
    PIN,
    STOPPED,
    TCY,
    WAVEFORM,
    ClockPin,
    MatchOperands,
    TimerOperands,
    fire_match,
    next_edges,
    read_count,
    write_count,
    write_period,
    write_ton,
)
from emu.system.device import Register
from emu.system.events import NEVER
from emu.system.rules import Rule, cell_of, event_slot


class Timer(Counter):
    """A 16-bit timer. With T32 set, a 32-bit timer that also uses its partner's registers."""

    def __init__(self, site: TimerSite, context: ChipContext) -> None:
        super().__init__(site, context)
        self.line: Final = self.irq(site.irq)
        self.low: Timer | None = None
        """For a type C timer, the type B timer that uses it while T32 is set."""
        self.high: Timer | None = None
        self._hold: Register | None = None
        self.period: Final = self.cell("period", "Q")
        """Tcy between two matches; 0 if the event is not periodic."""
        self.clear_from: Final = self.timestamp("clear_from")
        self.clear_until: Final = self.timestamp("clear_until")
        self.clear_due: Final = self.timestamp("clear_due", NEVER)
        """On a waveform clock: due cycle of the next match if TMR is cleared in clear_from <= cycle < clear_until."""
        self.closed: Final = self.timestamp("closed", NEVER)
        """Gated mode: cycle in which the interrupt flag rises after the gate's last falling edge."""
        self._match: Final = self.slot("match", self._fire)
        self._on_match: Final[list[Callable[[int], None]]] = []
        self._on_change: Final[list[Callable[[], None]]] = []
        self._listeners: Final = self.cell("listeners", "B")
        """Number of listeners in both lists together."""
        operands = self._rule_operands()
        self.tmr.set_rule(Rule(operands, read_count, write_count))
        self.pr.set_rule(Rule(operands, None, write_period))
        self._operands: Final = self._match_operands(operands)
        self.con.set_rule(Rule(self._operands, None, write_ton))
        self.set_event_rule(self._match, Rule(self._operands, fires=fire_match))
        self.tmr.computed(self.read)
        self.tmr.written_by(self._tmr_written)
        self.pr.written_by(self._period_written)
        self.con.written_by(self._con_written)
        if site.clock_pin:
            context.pins.watch(site.clock_pin, self._edge)
        context.pins.on_waveform_change(self._waveform_changes, self._waveform_changed)

    def _rule_operands(self) -> TimerOperands:
        cells = ("base", "tick", "period", "before", "phase", "clear_from", "clear_until", "clear_due", "listeners",
                 "frozen")  # fmt: skip
        operands = {name: cell_of(self.record, f"{self.name}.{name}") for name in cells}
        match, line = event_slot(self.record, self._match), self.line.line
        pair = self.con if self.site.kind != "C" else self.register(f"T{self.site.partner}CON")
        return TimerOperands(
            tmr=self.tmr.cell,
            pr=self.pr.cell,
            source=self._source.cell,
            pair=pair.cell,
            t32=1 << self.context.chip.sfrs[pair.name].fields["T32"][0] if self.site.kind != "A" else 0,
            match=match,
            line=line,
            **operands,
        )

    def _match_operands(self, operands: TimerOperands) -> MatchOperands:
        con = self.context.chip.sfrs[self.con.name]
        ton, tcs = (1 << con.fields[name][0] for name in ("TON", "TCS"))
        return MatchOperands(
            timer=operands,
            con=self.con.cell,
            writable=con.writable,
            ton=ton,
            tcs=tcs,
            tckps=con.fields["TCKPS"][0],
            clock=ClockPin(self.context.pins.rule_waveforms, (self._port, self._pin)),
            pin=self._pin,
        )

    def pair(self, high: Timer) -> None:
        """Join this timer with its type C partner (T2 with T3, T4 with T5)."""
        self.high, high.low = high, self
        self.upper, high.lower = high, self
        self._hold = self.register(f"TMR{high.site.number}HLD")
        self.tmr.read_by(self._read_and_latch)

    # -- register writes ---------------------------------------------------------------------------------------------

    def _plan(self, rewritten: bool = False) -> None:
        """Store `tick` and `period` for the rules, and post the next match after the current cycle."""
        self.clear_until.value = 0
        source = self._source.value
        simple = source == TCY and not self.is_upper_half
        if simple:
            self._empty_prescaler()
        narrow = simple and not self.is_wide  # a wide timer is read and interrupts through its partner
        self.tick.value = self._prescale if narrow else 0
        periodic = narrow and self.limit != 0 and not self._is_gated and not self._on_match
        self.period.value = (self.limit + 1) * self._prescale if periodic else 0
        if self._is_match_fixed(rewritten):
            self.period.value = 0  # the match after the next one is at another distance, so Python schedules it
        else:
            self._post(self.now)
        self._notify_change()

    def _empty_prescaler(self) -> None:
        """Convert the prescaler's content to an earlier `base`: rules compute the count from base and tick only."""
        self.base.value -= self._phase.value
        self._phase.value = 0

    def _notify_change(self) -> None:
        for listener in self._on_change:
            listener()

    def _is_match_fixed(self, rewritten: bool) -> bool:
        """Whether the current write cannot change the posted match, because its count has already been reached."""
        due = self.events.due(self._match)
        if due in (self.now + 1, self.closed.value) and due != NEVER:
            return True
        running = self._source.value in (TCY, WAVEFORM)
        return due == self.now + 2 and running and not rewritten and self.count(self.now + 1) == self.limit

    def _post(self, after: int) -> None:
        if self._is_gated or self.is_frozen:
            self.events.cancel(self._match)
            return
        match = self.next_cycle_at(self.limit, after)
        self.events.set(self._match, match + 1) if match != NEVER else self.events.cancel(self._match)

    @property
    def _is_gated(self) -> bool:
        return bool(self.con["TGATE"]) and not self.con["TCS"]

    def _choose_source(self) -> int:
        if self.is_upper_half or not self.con["TON"]:
            return STOPPED
        if self.con["TCS"]:
            return WAVEFORM if self.context.pins.waveform(self._port, self._pin) is not None else PIN
        if self.con["TGATE"] and not self.context.pins.level[self._port] & self._pin:
            return STOPPED
        return TCY

    def _tmr_written(self, _old: int, new: int, lanes: int) -> None:
        """Handle a write to TMR. The count applies from the next cycle on; the prescaler restarts (§7 rules 6, 8)."""
        if self.is_upper_half:
            assert self.low is not None
            self.low.high_written(new, lanes)
            return
        count = self.count(self.now)  # the write replaced the stored value, but only in the written lanes
        written = count & ~lanes & 0xFFFF | new & lanes
        if self.is_wide:
            assert self.high is not None
            assert self._hold is not None
            self.high.tmr.value = self._hold.value
        self.tmr.value = written
        self._before.value = written
        self._phase.value = 0
        self.base.value = self.now + 1
        self._plan(rewritten=True)

    def _post_edges(self, due: int) -> None:
        """Post the next match on a waveform clock, and store the prediction for a write that clears TMR."""
        self.clear_until.value = 0
        waveform, pin = self.context.pins.waveform(self._port, self._pin), self._pin
        if waveform is None or self.is_wide or not self.limit or self._on_change:
            self._post(due - 1)
            return
        following, *predicted = next_edges(
            self.bus.integers, self._operands, lambda after, count: waveform.nth_rise(pin, after, count))  # fmt: skip
        self.events.set(self._match, following)
        for cell, value in zip((self.clear_from, self.clear_until, self.clear_due), predicted, strict=True):
            cell.value = value

    def high_written(self, new: int, lanes: int) -> None:
        """Handle a direct write to the upper half of a 32-bit timer, a case that the manual does not describe (§7)."""
        assert self.high is not None
        self._fold(self.now + 1, self._prescale, self.limit)
        self.high.tmr.value = self.high.tmr.value & ~lanes | new & lanes
        self._plan()

    def _period_written(self, old: int, new: int, _lanes: int) -> None:
        """Handle a write to PR. Counts up to the next cycle still use the old PR."""
        owner = self.low if self.is_upper_half and self.low is not None else self
        shift = 0 if owner is self else 16
        previous = owner.limit & ~(0xFFFF << shift) | old << shift
        if old != new:
            owner.replan(previous)

    def replan(self, previous_limit: int) -> None:
        """Count up to the next cycle with `previous_limit`, then reschedule with the current registers."""
        self._fold(self.now + 1, self._prescale, previous_limit)
        self._plan()

    def _con_written(self, old: int, new: int, _lanes: int) -> None:
        if old == new:
            return
        if self.high is not None and (old ^ new) & self._t32:
            self._join_changed(old, new)
            return
        self._control_changed(old)

    @property
    def _t32(self) -> int:
        return 1 << self.context.chip.sfrs[self.con.name].fields["T32"][0] if self.high is not None else 0

    def _join_changed(self, old: int, new: int) -> None:
        """Handle a change of T32. Both halves keep their counts from the old configuration, then restart."""
        assert self.high is not None
        cycle = self.now + 1
        self.con.value = old
        halves = (self, self.high)
        counts = [half.count(cycle) & 0xFFFF for half in halves]
        self.con.value = new
        for half, value in zip(halves, counts, strict=True):
            half.tmr.value = value
            half._phase.value = 0
            half.base.value = cycle
            half._before.value = value
            half._source.value = half._choose_source()
        for half in halves:
            half._plan()

    def _control_changed(self, old_con: int) -> None:
        """Handle a change of TxCON. The prescaler is cleared when TON falls or the clock source changes (§7 rule 6).

        UNVERIFIED: other writes to TxCON keep the prescaler; by the data sheet, any write clears it.
        """
        present = self.con.value
        lsb, width = self.context.chip.sfrs[self.con.name].fields["TCKPS"]
        old_prescale = PRESCALE[old_con >> lsb & (1 << width) - 1]
        self._fold(self.now + 1, old_prescale, self.limit)
        clock_bits = sum(((1 << w) - 1) << b for b, w in map(self._field, ("TON", "TCKPS", "TCS", "TGATE")))
        if (present ^ old_con) & clock_bits:
            self._phase.value = 0
        self._before.value = self._start
        self._source.value = self._choose_source()
        self._plan()

    def _field(self, name: str) -> tuple[int, int]:
        return self.context.chip.sfrs[self.con.name].fields[name]

    # -- external clock and gate -------------------------------------------------------------------------------------

    def _edge(self, cycle: int, _changed: int, levels: int) -> None:
        if self.is_frozen or self.is_upper_half or not self.con["TON"]:
            return
        rising = bool(levels & self._pin)
        if self.con["TCS"]:
            if rising and self._source.value == PIN:
                self._count_edge(cycle)
        elif self.con["TGATE"]:
            self._gate(cycle, rising)

    def _count_edge(self, cycle: int) -> None:
        """Count a rising edge at `cycle`, which takes effect in the next cycle (§7 rule 9)."""
        self._before.value = self.count(cycle)
        self.base.value = cycle + 1
        phase = self._phase.value + 1
        if phase < self._prescale:
            self._phase.value = phase
            return
        self._phase.value = 0
        start = self._start
        self._start = count = advance(start, 1, self.limit, self.top)
        if count == self.limit and count != 0:
            self.events.set(self._match, cycle + 2)
        self._notify_change()

    def _gate(self, cycle: int, opened: bool) -> None:
        """Handle an edge of the gate, synchronised for one Tcy. The falling edge raises the flag (§7)."""
        self._fold(cycle + 1, self._prescale, self.limit)
        self._source.value = TCY if opened else STOPPED
        self._plan()
        if not opened:
            self.closed.value = cycle + 2
            self.events.set(self._match, cycle + 2)

    def _waveform_changes(self, cycle: int) -> None:
        """Count up to `cycle`, before the clock waveform changes."""
        if self._source.value in (WAVEFORM, PIN) and not self.is_frozen:
            self._fold(cycle, self._prescale, self.limit)

    def _waveform_changed(self) -> None:
        """Select the clock source again and reschedule, after the clock waveform has changed."""
        if self._source.value in (WAVEFORM, PIN):
            self._source.value = self._choose_source()
            self._plan()

    def listen(self, on_match: Callable[[int], None], wanted: bool) -> None:
        """Add the listener on_match(due) if `wanted`, else remove it. It is called at each match (ADC trigger, §13)."""
        if wanted != (on_match in self._on_match):
            self._on_match.append(on_match) if wanted else self._on_match.remove(on_match)
            self._listeners.value = len(self._on_change) + len(self._on_match)
            self._plan()

    def listen_to_changes(self, on_change: Callable[[], None], wanted: bool) -> None:
        """Add a listener if `wanted`, else remove it.

        It is called when future counts have changed (output compare, §9).
        """
        if wanted != (on_change in self._on_change):
            self._on_change.append(on_change) if wanted else self._on_change.remove(on_change)
            self._listeners.value = len(self._on_change) + len(self._on_match)

    # -- match -------------------------------------------------------------------------------------------------------

    def _fire(self, due: int) -> None:
        (self.high or self).line.request() if self.is_wide else self.line.request()
        for listener in self._on_match:
            listener(due)
        source = self._source.value
        if source == TCY:
            self._post(due - 1)
        elif source == WAVEFORM:
            self._post_edges(due)
        if self.tick.value and self.limit and not self._is_gated and not self._on_match:
            self.period.value = (self.limit + 1) * self.tick.value

    # -- power and reset ---------------------------------------------------------------------------------------------

    def reset(self, power_on: bool) -> None:
        """Reset to stopped. On silicon the count survives every reset except power-on; here it reads 0."""
        for cell in (self.base, self.tick, self.period, self._source, self._phase, self._before):
            cell.value = 0
        self.closed.value = NEVER

    def stops_in(self, mode: int) -> bool:
        """Whether the clock stops. Only timer 1 as asynchronous counter runs in Sleep (§7)."""
        if mode == SLEEP:
            return not (self.site.kind == "A" and self.con["TCS"] and not self.con["TSYNC"])
        owner = self.low if self.is_upper_half and self.low is not None else self
        return mode == IDLE and bool(owner.con["TSIDL"])

    def freeze(self, cycle: int, mode: int) -> None:
        """Count up to `cycle`, then stop the clock."""
        self.clear_until.value = 0
        self._fold(max(cycle, self.base.value), self._prescale, self.limit)
        super().freeze(cycle, mode)
        self._notify_change()

    def thaw(self, cycle: int) -> None:
        """Resume the clock. Gate and waveform clocks have continued, so their current state selects the source.

        A match that was already counted when the clock stopped still raises its flag.
        """
        waiting = self.remaining_delay(self._match)
        super().thaw(cycle)
        if not self.is_upper_half and self.con["TON"] and (self.con["TCS"] or self.con["TGATE"]):
            self._source.value = self._choose_source()
            self.tick.value = self._prescale if self._source.value == TCY and not self.is_wide else 0
            if self.con["TCS"] and (waiting == NEVER or waiting > 1):
                self._post(self.now)
        if self._source.value == TCY:
            self._empty_prescaler()
        self._notify_change()

    def before_disable(self) -> None:
        """Split a 32-bit pair, before its lower half is disabled."""
        if self.is_wide:
            joined = self.con.value
            self.con.value = joined & ~self._t32
            self._join_changed(joined, self.con.value)

    def restart(self) -> None:
        """Reset, then notify the listeners, because a disabled timer has no matches."""
        super().restart()
        self._notify_change()

    def _read_and_latch(self) -> int:
        """Return the lower half; in 32-bit mode also latch the upper half (§7)."""
        count = self.count(self.clock)
        if self._hold is not None and self.is_wide:
            self._hold.value = count >> 16
        return count & 0xFFFF


def timers(context: ChipContext) -> dict[int, Timer]:
    """Construct a chip's timers with joined pairs. Return them by number."""
    by_number = {site.number: Timer(site, context) for site in context.chip.timers}
    for site in context.chip.timers:
        if site.kind == "B":
            by_number[site.number].pair(by_number[site.partner])
    return by_number
