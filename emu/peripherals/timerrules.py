"""What instructions do to a plainly running timer (§7): TMR read and written, PR written; and its match.

The stored TMR word is the count at cycle `base`; `tick` Tcy make one count. A match is posted for the cycle in which
the flag is first 1. Wide, gated and pushed timers, and those that an output compare plans by, are `timers.py`'s.
"""

from __future__ import annotations

from dataclasses import dataclass

from emu.events import NEVER
from emu.straight import Line, Number, Place, Reader, Slot, request


@dataclass(frozen=True, slots=True)
class TimerPlaces:
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
    match: Slot
    line: Line


def read_count(m: Reader, t: TimerPlaces) -> Number:
    """TMR as it is read: (stored + ticks since base) modulo (PR + 1), while the stored count is not above PR."""
    tick, stored, top = m.get(t.tick), m.get(t.tmr), m.get(t.pr)
    m.need((tick != 0) & (stored <= top) & (m.get(t.frozen) == NEVER))
    passed = m.now - m.get(t.base)
    clocks = m.div(m.select(passed < 0, 0, passed), tick)
    return m.mod(stored + clocks, top + 1)


def write_count(m: Reader, t: TimerPlaces, value: Number, lanes: int) -> bool:
    """The written count stands from the next cycle, with an empty prescaler (§7 rules 6, 8).

    Of a timer on a described clock only clearing is here, where the device has foretold what that leads to.
    """
    if lanes != 0xFFFF:
        return False
    start, following, due = value & 0xFFFF, m.now + 1, m.get(t.match.due)
    tick, limit, period = m.get(t.tick), m.get(t.pr), m.get(t.period)
    plain = (period != 0) & (limit != 0)
    known = m.below(m.now, m.get(t.clear_until)) & (m.get(t.clear_from) <= m.now) & (due != following)
    foretold = (start == 0) & known
    m.need((plain | foretold) & _alone(m, t))
    stands = plain & (due == following)
    m.put(t.before, m.select(foretold, 0, m.get(t.before)))
    m.put(t.phase, m.select(foretold, 0, m.get(t.phase)))
    posted = m.select(foretold, m.get(t.clear_due), following + _counts_until(m, start, limit) * tick + 1)
    m.put(t.tmr, start)
    m.put(t.base, following)
    m.put(t.period, m.select(foretold | stands, 0, (limit + 1) * tick))
    m.post(t.match, m.select(stands, due, posted))
    return True


def write_period(m: Reader, t: TimerPlaces, value: Number, lanes: int) -> bool:
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


def fire_match(m: Reader, t: TimerPlaces) -> None:
    """A match of a timer that interrupts periodically (§7 rule 2)."""
    period = m.get(t.period)
    m.need(period != 0)
    request(m, t.line, m.now)
    m.post(t.match, m.now + period)


def _alone(m: Reader, t: TimerPlaces) -> Number:
    """Nobody need be told of changes, and the clock runs."""
    return (m.get(t.listeners) == 0) & (m.get(t.frozen) == NEVER)


def _counts_until(m: Reader, start: Number, limit: Number) -> Number:
    """Counts (at least 1) until the counter becomes `limit`, which is not 0."""
    behind = m.select(start < limit, limit - start, limit + 1)
    return m.select(start > limit, 0x10000 - start + limit, behind)
