"""Rules of a 16-bit timer (§7): reads and writes of TMR, writes of PR and TON, and the match.

The stored TMR value is the count at cycle `base`; one count takes `tick` Tcy. A match is posted for the cycle in which
the flag becomes 1. `timers.py` handles 32-bit and gated timers, timers clocked by pin edges, and those with listeners.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from emu.peripherals.pins import RuleWaveform
from emu.peripherals.timers.arithmetic import PRESCALE
from emu.system.events import NEVER
from emu.system.rules import Cell, EventSlot, InterruptLine, Number, RuleBuilder, request

STOPPED, TCY, PIN, WAVEFORM = range(4)
"""Clock sources: none, the instruction clock, edges of a pin, edges of an attached waveform."""


@dataclass(frozen=True, slots=True)
class TimerOperands:
    """Operands of the rules: registers and cells of one timer."""

    tmr: Cell
    pr: Cell
    base: Cell
    tick: Cell
    """Tcy per count; 0 unless this is a 16-bit timer that counts Tcy."""
    period: Cell
    """Tcy between two matches; 0 unless the timer interrupts periodically."""
    before: Cell
    phase: Cell
    clear_from: Cell
    clear_until: Cell
    clear_due: Cell
    listeners: Cell
    """Number of devices that listen to this timer."""
    frozen: Cell
    source: Cell
    pair: Cell
    """TxCON register that holds T32."""
    t32: int
    """Mask of T32; 0 for a timer that is not part of a pair."""
    match: EventSlot
    line: InterruptLine


def read_count(m: RuleBuilder, t: TimerOperands) -> Number:
    """Return TMR: (stored + ticks since base) modulo (PR + 1), if the stored count does not exceed PR."""
    tick, stored, top = m.get(t.tick), m.get(t.tmr), m.get(t.pr)
    m.require((tick != 0) & (stored <= top) & (m.get(t.frozen) == NEVER))
    passed = m.now - m.get(t.base)
    clocks = m.div(m.select(passed < 0, 0, passed), tick)
    return m.mod(stored + clocks, top + 1)


def write_count(m: RuleBuilder, t: TimerOperands, value: Number, lanes: int) -> bool:
    """Write TMR. The count applies from the next cycle on, with an empty prescaler (§7 rules 6, 8).

    For a timer clocked by a waveform, the rule supports only clearing, with a match that the device has predicted. For
    a stopped timer without a pending match, it supports every value.
    """
    if lanes != 0xFFFF:
        return False
    start, following, due = value & 0xFFFF, m.now + 1, m.get(t.match.due)
    tick, limit, period = m.get(t.tick), m.get(t.pr), m.get(t.period)
    plain = (period != 0) & (limit != 0)
    known = m.below(m.now, m.get(t.clear_until)) & (m.get(t.clear_from) <= m.now) & (due != following)
    predicted = (start == 0) & known
    stopped = (m.get(t.source) == STOPPED) & ((m.get(t.pair) & t.t32) == 0) & (due == NEVER)
    m.require((plain | predicted | stopped) & _has_no_listener(m, t))
    is_fixed = plain & (due == following)
    m.put(t.before, m.select(plain, m.get(t.before), start))
    m.put(t.phase, m.select(plain, m.get(t.phase), 0))
    posted = m.select(predicted, m.get(t.clear_due), following + _counts_until(m, start, limit) * tick + 1)
    posted = m.select(stopped, NEVER, posted)
    m.put(t.tmr, start)
    m.put(t.base, following)
    m.put(t.clear_until, m.select(stopped, 0, m.get(t.clear_until)))
    m.put(t.period, m.select(predicted | stopped | is_fixed, 0, (limit + 1) * tick))
    m.post(t.match, m.select(is_fixed, due, posted))
    return True


def write_period(m: RuleBuilder, t: TimerOperands, value: Number, lanes: int) -> bool:
    """Write PR: count up to the next cycle with the old PR, from then on with the new one."""
    if lanes != 0xFFFF:
        return False
    limit, following, due = value & 0xFFFF, m.now + 1, m.get(t.match.due)
    tick, stored, old, base = m.get(t.tick), m.get(t.tmr), m.get(t.pr), m.get(t.base)
    m.require((m.get(t.period) != 0) & (limit != 0) & (stored <= old) & (base <= following) & _has_no_listener(m, t))
    passed = following - base
    start, begun = m.mod(stored + m.div(passed, tick), old + 1), following - m.mod(passed, tick)
    is_fixed = (due == following) | ((due == following + 1) & (start == limit))
    m.put(t.pr, limit)
    m.put(t.tmr, start)
    m.put(t.base, begun)
    m.put(t.period, m.select(is_fixed, 0, (limit + 1) * tick))
    m.post(t.match, m.select(is_fixed, due, begun + _counts_until(m, start, limit) * tick + 1))
    return True


@dataclass(frozen=True, slots=True)
class ClockPin:
    """Clock input pin of a timer."""

    pins: Mapping[tuple[int, int], tuple[RuleWaveform, Cell]]
    name: tuple[int, int]

    @property
    def rule_waveform(self) -> tuple[RuleWaveform, Cell] | None:
        """The rule waveform on the pin and the cell that says whether it is attached; None if there is none."""
        return self.pins.get(self.name)

    def __repr__(self) -> str:
        """Return a text that is equal in every process, because the key of cached native code contains it."""
        wave = self.rule_waveform
        return f"ClockPin({self.name}, {wave and (type(wave[0]).__name__, wave[1])})"


@dataclass(frozen=True, slots=True)
class MatchOperands:
    """Operands of the match rule and the TON rule."""

    timer: TimerOperands
    con: Cell
    writable: int
    ton: int
    tcs: int
    tckps: int
    """Bit position of TCKPS in TxCON."""
    clock: ClockPin
    pin: int


def fire_match(m: RuleBuilder, p: MatchOperands) -> None:
    """Handle the match of a timer that interrupts periodically (§7 rule 2) or is clocked by a rule waveform."""
    t, clock = p.timer, p.clock.rule_waveform
    period = m.get(t.period)
    if clock is None:
        m.require(period != 0)
        m.post(t.match, m.now + period)
    else:
        wave, attached = clock
        narrow = (m.get(t.pair) & t.t32) == 0
        counts = (m.get(t.source) == WAVEFORM) & narrow & (m.get(attached) != 0)
        on_waveform = counts & (m.get(t.pr) != 0) & (m.get(t.listeners) == 0) & (period == 0)
        m.require((period != 0) | on_waveform)
        cells = (t.clear_from, t.clear_until, t.clear_due)
        due, *predicted = m.lazy_select(
            on_waveform, lambda: next_edges(m, p, lambda after, count: wave.nth_rise_rule(m, p.pin, after, count)),
            m.now + period, *(m.get(cell) for cell in cells))  # fmt: skip
        for cell, value in zip(cells, predicted, strict=True):
            m.put(cell, value)
        m.post(t.match, due)
    request(m, t.line, m.now)


def next_edges(m: RuleBuilder, p: MatchOperands, nth_rise: Callable[[Number, Number], Number]) -> tuple[Number, ...]:
    """Return the due cycle of the next match of a waveform clock, and a prediction for a write that clears TMR.

    Firmware that counts camera lines clears TMR after a match. The prediction has three parts: first cycle and end of
    the interval in which it holds, and the due cycle of the match after clearing TMR in that interval.
    """
    limit = m.get(p.timer.pr)
    prescale = m.table(PRESCALE, m.get(p.con) >> p.tckps & len(PRESCALE) - 1)

    def due(after: Number, clocks: Number) -> Number:
        edge = nth_rise(after, clocks)
        return m.select(edge == NEVER, NEVER, edge + 2)

    return due(m.now - 2, (limit + 1) * prescale), m.now, nth_rise(m.now, 1), due(m.now, limit * prescale)


def write_ton(m: RuleBuilder, p: MatchOperands, value: Number, lanes: int) -> bool:
    """Write TxCON of a timer with a waveform clock if at most TON changes.

    Off: the count is known if, since the last write, either no edge has occurred or exactly those up to the match. On:
    counting starts in the next cycle. In both cases the prescaler is empty (§7 rule 6).
    """
    t, clock = p.timer, p.clock.rule_waveform
    if clock is None or not lanes & p.ton:
        return False
    wave, attached = clock
    old, source, tmr, limit = m.get(p.con), m.get(t.source), m.get(t.tmr), m.get(t.pr)
    free = p.writable & lanes
    new = (old & (0xFFFF & ~free)) | (value & free)
    starts = (new & p.ton) != 0
    same = old == new
    counts = ((new & p.tcs) != 0) & (source == m.select(starts, STOPPED, WAVEFORM)) & ((m.get(t.pair) & t.t32) == 0)
    m.require(same | (((old ^ new) == p.ton) & counts & (m.get(attached) != 0) & (limit != 0) & _has_no_listener(m, t)))
    prescale = m.table(PRESCALE, new >> p.tckps & len(PRESCALE) - 1)
    clocks = _counts_until(m, tmr, limit) * prescale - m.select(starts, 0, m.get(t.phase))
    after = m.select(starts, m.now, m.get(t.base) - 1)
    edge = wave.nth_rise_rule(m, p.pin, after, clocks)
    matched = m.select(starts, 0, m.below(m.now, edge) == 0)
    following = wave.nth_rise_rule(m, p.pin, after, m.select(matched, clocks, 0) + 1)
    m.require(same | starts | m.below(m.now, following))
    count, due = m.select(matched, limit, tmr), m.get(t.match.due)
    is_fixed = (due == m.now + 1) | (starts & (due == m.now + 2) & (count == limit))
    posted = m.select(starts & (edge != NEVER), edge + 2, NEVER)
    m.put(p.con, new)
    changed = [(t.tmr, count), (t.base, m.now + 1), (t.before, count), (t.source, m.select(starts, WAVEFORM, STOPPED))]
    changed += [(place, 0) for place in (t.phase, t.tick, t.period, t.clear_until)]
    for place, value in changed:
        m.put(place, m.select(same, m.get(place), value))
    m.post(t.match, m.select(same | is_fixed, due, posted))
    return True


def _has_no_listener(m: RuleBuilder, t: TimerOperands) -> Number:
    """Return whether no device listens to the timer and its clock runs."""
    return (m.get(t.listeners) == 0) & (m.get(t.frozen) == NEVER)


def _counts_until(m: RuleBuilder, start: Number, limit: Number) -> Number:
    """Return the number of counts, at least 1, until the counter becomes `limit`, which is not 0."""
    behind = m.select(start < limit, limit - start, limit + 1)
    return m.select(start > limit, 0x10000 - start + limit, behind)
