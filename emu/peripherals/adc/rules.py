"""Rules of the ADC (§13): reads of stable registers, ADON, ADCSSL and complete conversion sequences."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from emu.peripherals.adc.settings import FOREVER
from emu.system.events import NEVER
from emu.system.rules import Cell, EventSlot, InterruptLine, Number, RuleBuilder, request

BUFFERS: Final = 16
"""Number of result buffers."""
CHANNELS: Final = 16
"""Number of inputs of the multiplexer. UNVERIFIED: inputs without a pin read 0."""
OFF, WAITING, SAMPLING, CONVERTING = range(4)
"""States of the converter: off (ADON = 0), idle, sampling (SAMP = 1), converting."""


@dataclass(frozen=True, slots=True)
class StableRegister:
    """A register that the converter changes, but not before the cycle stored in the cell `until`."""

    register: Cell
    until: Cell


def read_stable(m: RuleBuilder, p: StableRegister) -> Number:
    """Return the stored value, which is valid before cycle `until`."""
    m.require(m.now < m.get(p.until))
    return m.get(p.register)


@dataclass(frozen=True, slots=True)
class AdcOperands:
    """Operands of the ADC's rules: ADCON1 and ADCON2 with their bits, and the converter's cells."""

    register: Cell
    until: Cell
    con2: Cell
    writable: int
    clear_only: int
    adon: int
    samp: int
    bufs: int
    cssl: Cell
    scannable: int
    """Mask of the implemented bits of ADCSSL."""
    cscna: int
    native: Cell
    frozen: Cell
    sampling: Cell
    conversion: Cell
    results: Cell
    halves: Cell
    """BUFM: whether each interrupt switches to the other half of the result buffer."""
    state: Cell
    mark: Cell
    half: Cell
    scan: Cell
    use_b: Cell
    next: Cell
    count: Cell
    held: Cell
    length: Cell
    channels: Cell
    """Cell of the scan sequence's first element."""
    level: Cell
    """Cell of the level of channel 0; the other channels' cells follow."""
    shift: int
    """Number of low bits of a level that the result does not have: 16 minus the resolution."""
    level_from: Cell
    """Cell of the first cycle in which `level` of channel 0 is valid; the other channels' cells follow."""
    native_source: Cell
    """Cell of the native source of channel 0: function address, then data pointer. The other channels' cells follow."""
    buffer: Cell
    """Cell of ADCBUF0; the other result buffers follow."""
    done: int
    step: EventSlot
    line: InterruptLine


def write_con1(m: RuleBuilder, p: AdcOperands, value: Number, lanes: int) -> bool:
    """Write ADCON1 if only ADON changes.

    On: SAMP becomes 1, and sampling of the first channel starts in the next cycle. Off: SAMP becomes 0, and a running
    conversion is lost.
    """
    old = m.get(p.register)
    free, kept = p.writable & lanes, p.clear_only & lanes
    new = (old & (0xFFFF & ~(free | kept))) | (value & free) | (old & value & kept)
    plain = (m.get(p.native) != 0) & (m.get(p.frozen) == NEVER)
    settings = 0xFFFF & ~(p.samp | p.done)
    m.require((((old ^ new) & settings) == p.adon) & plain & (m.now < m.get(p.until)))
    starts, con2 = (new & p.adon) != 0, m.get(p.con2)
    sampling = m.get(p.sampling)
    begun = (m.now + 1) << 1
    end = begun + m.get(p.results) * (sampling + m.get(p.conversion))
    cleared = ((place, 0) for place in (p.half, p.scan, p.use_b, p.next, p.count))
    for place, first in ((p.mark, m.now + 1), *cleared):
        m.put(place, m.select(starts, first, m.get(place)))
    m.put(p.register, m.select(starts, new | p.samp, new & (0xFFFF & ~p.samp)))
    m.put(p.con2, m.select(starts, con2 & (0xFFFF & ~p.bufs), con2))
    m.put(p.state, m.select(starts, SAMPLING, OFF))
    m.put(p.until, m.select(starts, (begun + sampling + 1) >> 1, FOREVER))
    m.post(p.step, m.select(starts, (end + 1) >> 1, NEVER))
    return True


def write_scan(m: RuleBuilder, p: AdcOperands, value: Number, lanes: int) -> bool:
    """Write ADCSSL while the converter is off, and rebuild the scan sequence."""
    if lanes != 0xFFFF:
        return False
    chosen = value & p.scannable
    m.require((m.get(p.native) != 0) & (m.get(p.state) == OFF) & ((m.get(p.con2) & p.cscna) != 0) & (chosen != 0))
    length: Number = 0
    for channel in range(CHANNELS):
        is_chosen = (chosen >> channel) & 1
        m.put(p.channels, m.select(is_chosen, channel, m.get(p.channels, length)), length)
        length = length + is_chosen
    m.put(p.length, length)
    m.put(p.cssl, chosen)
    return True


def fire_round(m: RuleBuilder, p: AdcOperands) -> None:
    """Complete all conversions up to the interrupt that is due.

    Required: automatic sampling, one multiplexer, and inputs that are constant or have a native source.
    """
    sampling, results, length = m.get(p.sampling), m.get(p.results), m.get(p.length)
    step, scan, count, following = sampling + m.get(p.conversion), m.get(p.scan), m.get(p.count), m.get(p.next)
    begun, missing = (m.get(p.mark) << 1) + m.get(p.half), results - count
    end = begun + missing * step
    plain = (m.get(p.native) != 0) & (m.get(p.state) == SAMPLING) & (m.get(p.use_b) == 0)
    m.require(plain & (count < results) & (scan < length) & ((end + 1) >> 1 == m.now))

    def next_place(place: Number) -> Number:
        return m.select(place + 1 < length, place + 1, 0)

    def is_known(_turn: Number, place: Number, cycle: Number) -> tuple[Number, ...]:
        channel = m.get(p.channels, place)
        holds = m.get(p.level_from, channel) <= (cycle + sampling + 1) >> 1
        m.require(holds | m.can_call(m.get(p.native_source, channel << 1)))
        return next_place(place), cycle + step

    def convert(turn: Number, place: Number, cycle: Number, _held: Number) -> tuple[Number, ...]:
        channel, sampled = m.get(p.channels, place), (cycle + sampling + 1) >> 1
        code, data = m.get(p.native_source, channel << 1), m.get(p.native_source, (channel << 1) + 1)
        (level,) = m.lazy_select(m.get(p.level_from, channel) > sampled,
                            lambda: (m.call(code, data, channel, sampled),), m.get(p.level, channel))  # fmt: skip
        m.put(p.buffer, level >> p.shift, (following + turn) & (BUFFERS - 1))
        return next_place(place), cycle + step, level >> p.shift

    m.loop(missing, is_known, scan, begun)
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
