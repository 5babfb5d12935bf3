"""The converter (§13) in the common case: registers that stand, ADON switched, whole rounds of conversions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from emu.peripherals.adc.schedule import FOREVER
from emu.system.events import NEVER
from emu.system.rules import Line, Number, Place, Reader, Slot, request

BUFFERS: Final = 16
"""Results that are kept."""
CHANNELS: Final = 16
"""Positions of the multiplexer; those without a pin read 0. UNVERIFIED."""
OFF, WAITING, SAMPLING, CONVERTING = range(4)
"""States: ADON = 0; nothing connected; SAMP = 1; SAMP = 0 and the converter at work."""


@dataclass(frozen=True, slots=True)
class StableRegister:
    """A register the converter changes by itself, but not before a cycle it has published."""

    register: Place
    until: Place


def read_stable(m: Reader, p: StableRegister) -> Number:
    """What is stored, until then."""
    m.need(m.now < m.get(p.until))
    return m.get(p.register)


@dataclass(frozen=True, slots=True)
class AdcOperands:
    """ADCON1 and ADCON2 with their bits, and cells of the converter."""

    register: Place
    until: Place
    con2: Place
    writable: int
    clear_only: int
    adon: int
    samp: int
    bufs: int
    cssl: Place
    scannable: int
    """Bits of ADCSSL."""
    cscna: int
    native: Place
    frozen: Place
    sampling: Place
    conversion: Place
    results: Place
    halves: Place
    """Whether every interrupt turns to the other half of the results."""
    state: Place
    mark: Place
    half: Place
    scan: Place
    use_b: Place
    next: Place
    count: Place
    held: Place
    length: Place
    channels: Place
    """The first of the inputs in turn."""
    level: Place
    """Of channel 0."""
    level_from: Place
    """Of channel 0: first cycle in which `level` is what it shows."""
    asked: Place
    """Of channel 0: host code that knows its level before that, and behind it that code's data."""
    buffer: Place
    """ADCBUF0."""
    done: int
    step: Slot
    line: Line


def write_con1(m: Reader, p: AdcOperands, value: Number, lanes: int) -> bool:
    """ADON changes and no setting does. On: sampling begins with the next cycle, from the first channel on. Off: the
    conversion under way is lost. SAMP is the converter's in both cases."""
    old = m.get(p.register)
    free, kept = p.writable & lanes, p.clear_only & lanes
    new = (old & (0xFFFF & ~(free | kept))) | (value & free) | (old & value & kept)
    plain = (m.get(p.native) != 0) & (m.get(p.frozen) == NEVER)
    settings = 0xFFFF & ~(p.samp | p.done)
    m.need((((old ^ new) & settings) == p.adon) & plain & (m.now < m.get(p.until)))
    starts, con2 = (new & p.adon) != 0, m.get(p.con2)
    sampling = m.get(p.sampling)
    begun = (m.now + 1) << 1
    end = begun + m.get(p.results) * (sampling + m.get(p.conversion))
    anew = ((place, 0) for place in (p.half, p.scan, p.use_b, p.next, p.count))
    for place, first in ((p.mark, m.now + 1), *anew):
        m.put(place, m.select(starts, first, m.get(place)))
    m.put(p.register, m.select(starts, new | p.samp, new & (0xFFFF & ~p.samp)))
    m.put(p.con2, m.select(starts, con2 & (0xFFFF & ~p.bufs), con2))
    m.put(p.state, m.select(starts, SAMPLING, OFF))
    m.put(p.until, m.select(starts, (begun + sampling + 1) >> 1, FOREVER))
    m.post(p.step, m.select(starts, (end + 1) >> 1, NEVER))
    return True


def write_scan(m: Reader, p: AdcOperands, value: Number, lanes: int) -> bool:
    """ADCSSL written while the converter is off: the channels in turn from now on."""
    if lanes != 0xFFFF:
        return False
    chosen = value & p.scannable
    m.need((m.get(p.native) != 0) & (m.get(p.state) == OFF) & ((m.get(p.con2) & p.cscna) != 0) & (chosen != 0))
    length: Number = 0
    for channel in range(CHANNELS):
        is_chosen = (chosen >> channel) & 1
        m.put(p.channels, m.select(is_chosen, channel, m.get(p.channels, length)), length)
        length = length + is_chosen
    m.put(p.length, length)
    m.put(p.cssl, chosen)
    return True


def fire_round(m: Reader, p: AdcOperands) -> None:
    """All conversions up to the interrupt that is due: automatic, one multiplexer, inputs that hold, were predicted to,
    or are known to host code."""
    sampling, results, length = m.get(p.sampling), m.get(p.results), m.get(p.length)
    step, scan, count, following = sampling + m.get(p.conversion), m.get(p.scan), m.get(p.count), m.get(p.next)
    begun, missing = (m.get(p.mark) << 1) + m.get(p.half), results - count
    end = begun + missing * step
    plain = (m.get(p.native) != 0) & (m.get(p.state) == SAMPLING) & (m.get(p.use_b) == 0)
    m.need(plain & (count < results) & (scan < length) & ((end + 1) >> 1 == m.now))

    def behind(place: Number) -> Number:
        return m.select(place + 1 < length, place + 1, 0)

    def known(_turn: Number, place: Number, cycle: Number) -> tuple[Number, ...]:
        channel = m.get(p.channels, place)
        holds = m.get(p.level_from, channel) <= (cycle + sampling + 1) >> 1
        m.need(holds | m.can_ask(m.get(p.asked, channel << 1)))
        return behind(place), cycle + step

    def convert(turn: Number, place: Number, cycle: Number, _held: Number) -> tuple[Number, ...]:
        channel, sampled = m.get(p.channels, place), (cycle + sampling + 1) >> 1
        code, data = m.get(p.asked, channel << 1), m.get(p.asked, (channel << 1) + 1)
        (level,) = m.either(m.get(p.level_from, channel) > sampled,
                            lambda: (m.ask(code, data, channel, sampled),), m.get(p.level, channel))  # fmt: skip
        m.put(p.buffer, level >> 4, (following + turn) & (BUFFERS - 1))
        return behind(place), cycle + step, level >> 4

    m.loop(missing, known, scan, begun)
    _place, _cycle, held = m.loop(missing, convert, scan, begun, 0)
    con2, halves = m.get(p.con2), m.get(p.halves) != 0
    turned = m.select(halves, con2 ^ p.bufs, con2)
    first = m.select(halves & ((turned & p.bufs) != 0), BUFFERS // 2, 0)
    for cell, value in ((p.held, held), (p.scan, 0), (p.count, 0), (p.next, first), (p.con2, turned),
                        (p.mark, end >> 1), (p.half, end & 1)):  # fmt: skip
        m.put(cell, value)
    m.put(p.register, m.get(p.register) | p.samp | p.done)
    m.put(p.until, (end + sampling + 1) >> 1)
    m.post(p.step, (end + results * step + 1) >> 1)
    request(m, p.line, m.now)
