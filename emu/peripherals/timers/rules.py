"""What instructions do to a plainly running timer (§7): TMR read and written, PR written; and its match.

The stored TMR word is the count at cycle `base`; `tick` Tcy make one count. A match is posted for the cycle in which
the flag is first 1. Wide, gated and pushed timers, and those that an output compare plans by, are `timers.py`'s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from emu.peripherals.pins import RuleWaveform
from emu.peripherals.timers.arithmetic import PRESCALE
from emu.system.events import NEVER
from emu.system.rules import Line, Number, Place, Reader, Slot, request

STOPPED, TCY, PIN, WAVE = range(4)
"""Clock sources: none, the instruction clock, edges pushed by a pin, edges of a described waveform."""


@dataclass(frozen=True, slots=True)
class TimerOperands:
    """Registers and cells of one timer."""

    tmr: Place
    pr: Place
    base: Place
    tick: Place
    """0 unless the timer counts Tcy by itself, 16 bits wide."""
    period: Place
    """0 unless it also interrupts periodically."""
    before: Place
    phase: Place
    clear_from: Place
    clear_until: Place
    clear_due: Place
    listeners: Place
    """How many devices plan by this timer."""
    frozen: Place
    source: Place
    pair: Place
    """The TxCON that T32 is in."""
    t32: int
    """T32, 0 for a timer that is not one of a pair."""
    match: Slot
    line: Line


def read_count(m: Reader, t: TimerOperands) -> Number:
    """TMR as it is read: (stored + ticks since base) modulo (PR + 1), while the stored count is not above PR."""
    tick, stored, top = m.get(t.tick), m.get(t.tmr), m.get(t.pr)
    m.need((tick != 0) & (stored <= top) & (m.get(t.frozen) == NEVER))
    passed = m.now - m.get(t.base)
    clocks = m.div(m.select(passed < 0, 0, passed), tick)
    return m.mod(stored + clocks, top + 1)


def write_count(m: Reader, t: TimerOperands, value: Number, lanes: int) -> bool:
    """The written count stands from the next cycle, with an empty prescaler (§7 rules 6, 8).

    Of a timer on a described clock only clearing is here, where the device has predicted what that leads to; of one that
    stands with no match on its way, all.
    """
    if lanes != 0xFFFF:
        return False
    start, following, due = value & 0xFFFF, m.now + 1, m.get(t.match.due)
    tick, limit, period = m.get(t.tick), m.get(t.pr), m.get(t.period)
    plain = (period != 0) & (limit != 0)
    known = m.below(m.now, m.get(t.clear_until)) & (m.get(t.clear_from) <= m.now) & (due != following)
    predicted = (start == 0) & known
    still = (m.get(t.source) == STOPPED) & ((m.get(t.pair) & t.t32) == 0) & (due == NEVER)
    m.need((plain | predicted | still) & _alone(m, t))
    stands = plain & (due == following)
    m.put(t.before, m.select(plain, m.get(t.before), start))
    m.put(t.phase, m.select(plain, m.get(t.phase), 0))
    posted = m.select(predicted, m.get(t.clear_due), following + _counts_until(m, start, limit) * tick + 1)
    posted = m.select(still, NEVER, posted)
    m.put(t.tmr, start)
    m.put(t.base, following)
    m.put(t.clear_until, m.select(still, 0, m.get(t.clear_until)))
    m.put(t.period, m.select(predicted | still | stands, 0, (limit + 1) * tick))
    m.post(t.match, m.select(stands, due, posted))
    return True


def write_period(m: Reader, t: TimerOperands, value: Number, lanes: int) -> bool:
    """Count up to the next cycle with the old PR, then go on with the new one."""
    if lanes != 0xFFFF:
        return False
    limit, following, due = value & 0xFFFF, m.now + 1, m.get(t.match.due)
    tick, stored, old, base = m.get(t.tick), m.get(t.tmr), m.get(t.pr), m.get(t.base)
    m.need((m.get(t.period) != 0) & (limit != 0) & (stored <= old) & (base <= following) & _alone(m, t))
    passed = following - base
    start, begun = m.mod(stored + m.div(passed, tick), old + 1), following - m.mod(passed, tick)
    stands = (due == following) | ((due == following + 1) & (start == limit))
    m.put(t.pr, limit)
    m.put(t.tmr, start)
    m.put(t.base, begun)
    m.put(t.period, m.select(stands, 0, (limit + 1) * tick))
    m.post(t.match, m.select(stands, due, begun + _counts_until(m, start, limit) * tick + 1))
    return True


@dataclass(frozen=True, slots=True)
class ClockPin:
    """Where a timer's clock comes in."""

    pins: Mapping[tuple[int, int], tuple[RuleWaveform, Place]]
    name: tuple[int, int]

    @property
    def described(self) -> tuple[RuleWaveform, Place] | None:
        """The waveform on it that every engine can read, and the place that says whether it is there."""
        return self.pins.get(self.name)

    def __repr__(self) -> str:
        """The same in every process: native code is named by it."""
        wave = self.described
        return f"ClockPin({self.name}, {wave and (type(wave[0]).__name__, wave[1])})"


@dataclass(frozen=True, slots=True)
class MatchOperands:
    """What a match looks at, too."""

    timer: TimerOperands
    con: Place
    writable: int
    ton: int
    tcs: int
    tckps: int
    """Its lowest bit."""
    clock: ClockPin
    pin: int


def fire_match(m: Reader, p: MatchOperands) -> None:
    """A match of a timer that interrupts periodically (§7 rule 2), or on a described clock."""
    t, clock = p.timer, p.clock.described
    period = m.get(t.period)
    if clock is None:
        m.need(period != 0)
        m.post(t.match, m.now + period)
    else:
        wave, attached = clock
        narrow = (m.get(t.pair) & t.t32) == 0
        counts = (m.get(t.source) == WAVE) & narrow & (m.get(attached) != 0)
        waves = counts & (m.get(t.pr) != 0) & (m.get(t.listeners) == 0) & (period == 0)
        m.need((period != 0) | waves)
        cells = (t.clear_from, t.clear_until, t.clear_due)
        due, *predicted = m.either(
            waves, lambda: next_edges(m, p, lambda after, count: wave.nth_rise_rule(m, p.pin, after, count)),
            m.now + period, *(m.get(cell) for cell in cells))  # fmt: skip
        for cell, value in zip(cells, predicted, strict=True):
            m.put(cell, value)
        m.post(t.match, due)
    request(m, t.line, m.now)


def next_edges(m: Reader, p: MatchOperands, nth_rise: Callable[[Number, Number], Number]) -> tuple[Number, ...]:
    """After a match on a described clock: when the next one is due, and what clearing TMR leads to, because firmware
    that counts lines does that now: from when until when, and the match it leads to."""
    limit = m.get(p.timer.pr)
    prescale = m.table(PRESCALE, m.get(p.con) >> p.tckps & len(PRESCALE) - 1)

    def due(after: Number, clocks: Number) -> Number:
        edge = nth_rise(after, clocks)
        return m.select(edge == NEVER, NEVER, edge + 2)

    return due(m.now - 2, (limit + 1) * prescale), m.now, nth_rise(m.now, 1), due(m.now, limit * prescale)


def switch(m: Reader, p: MatchOperands, value: Number, lanes: int) -> bool:
    """TON changes and nothing else, on a described clock. Off: the count is known if there was no edge since it was
    written, or just those to the match. On: counting begins with the next cycle. The prescaler is empty (§7 rule 6).
    Nothing changes: that is no new course."""
    t, clock = p.timer, p.clock.described
    if clock is None or not lanes & p.ton:
        return False
    wave, attached = clock
    old, source, tmr, limit = m.get(p.con), m.get(t.source), m.get(t.tmr), m.get(t.pr)
    free = p.writable & lanes
    new = (old & (0xFFFF & ~free)) | (value & free)
    starts = (new & p.ton) != 0
    same = old == new
    counts = ((new & p.tcs) != 0) & (source == m.select(starts, STOPPED, WAVE)) & ((m.get(t.pair) & t.t32) == 0)
    m.need(same | (((old ^ new) == p.ton) & counts & (m.get(attached) != 0) & (limit != 0) & _alone(m, t)))
    prescale = m.table(PRESCALE, new >> p.tckps & len(PRESCALE) - 1)
    clocks = _counts_until(m, tmr, limit) * prescale - m.select(starts, 0, m.get(t.phase))
    after = m.select(starts, m.now, m.get(t.base) - 1)
    edge = wave.nth_rise_rule(m, p.pin, after, clocks)
    matched = m.select(starts, 0, m.below(m.now, edge) == 0)
    following = wave.nth_rise_rule(m, p.pin, after, m.select(matched, clocks, 0) + 1)
    m.need(same | starts | m.below(m.now, following))
    count, due = m.select(matched, limit, tmr), m.get(t.match.due)
    stands = (due == m.now + 1) | (starts & (due == m.now + 2) & (count == limit))
    posted = m.select(starts & (edge != NEVER), edge + 2, NEVER)
    m.put(p.con, new)
    changed = [(t.tmr, count), (t.base, m.now + 1), (t.before, count), (t.source, m.select(starts, WAVE, STOPPED))]
    changed += [(place, 0) for place in (t.phase, t.tick, t.period, t.clear_until)]
    for place, value in changed:
        m.put(place, m.select(same, m.get(place), value))
    m.post(t.match, m.select(same | stands, due, posted))
    return True


def _alone(m: Reader, t: TimerOperands) -> Number:
    """Nobody need be told of changes, and the clock runs."""
    return (m.get(t.listeners) == 0) & (m.get(t.frozen) == NEVER)


def _counts_until(m: Reader, start: Number, limit: Number) -> Number:
    """Counts (at least 1) until the counter becomes `limit`, which is not 0."""
    behind = m.select(start < limit, limit - start, limit + 1)
    return m.select(start > limit, 0x10000 - start + limit, behind)
