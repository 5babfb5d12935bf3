"""What instructions do to a port (§6): LAT and PORT written, PORT read, where nobody need be told at once."""

from __future__ import annotations

from dataclasses import dataclass

from emu.system.rules import Number, Place, Reader


@dataclass(frozen=True, slots=True)
class Stretch:
    """Pins of one port that show bytes from the record, one after the other: byte k from `begin` + k `width` on."""

    mask: int
    shift: int
    begin: Place
    end: Place
    first: Place
    width: Place


@dataclass(frozen=True, slots=True)
class PortOperands:
    """Registers of a port and its words in the arrays of `pins.py`."""

    number: int
    implemented: int
    lat: Place
    port: Place
    owned: Place
    output: Place
    level: Place
    drive: Place
    analog: Place
    eager: Place
    lazy: Place
    before: Place
    waveform_pins: Place
    constant_levels: Place
    constant_until: Place
    changed: Place
    ring: Place
    ring_size: int
    ring_count: Place
    stretch: Stretch | None = None


def read_port(m: Reader, p: PortOperands) -> Number:
    """Levels of the pins; outputs show one cycle late. Waveforms: while they stand, or show bytes of the record."""
    levels = m.select(m.now <= m.get(p.changed), m.get(p.before), m.get(p.level))
    waveform_pins = m.get(p.waveform_pins)
    stands = m.below(m.now, m.get(p.constant_until)) | (waveform_pins == 0)
    constant_levels = (levels & (waveform_pins ^ 0xFFFF)) | (m.get(p.constant_levels) & waveform_pins)
    if p.stretch is None:
        m.need(stands)
        return constant_levels
    s = p.stretch
    begin, width = m.get(s.begin), m.get(s.width)
    inside = (m.now >= begin) & (m.now < m.get(s.end)) & ((waveform_pins & (0xFFFF & ~s.mask)) == 0)
    m.need(stands | inside)
    place = m.div(m.select(inside, m.now - begin, 0), m.select(width == 0, 1, width))
    shown = (levels & (0xFFFF & ~s.mask)) | (m.get(s.first, place) << s.shift)
    return m.select(stands, constant_levels, shown)


def _write(is_port: bool, m: Reader, p: PortOperands, value: Number, lanes: int) -> bool:
    """New levels from the next cycle on; lazy watchers find them in the ring."""
    free = p.implemented & lanes
    new = (m.get(p.lat) & (0xFFFF & ~free)) | (value & free)
    own, drive, level, waveform_pins = m.get(p.owned), m.get(p.drive), m.get(p.level), m.get(p.waveform_pins)
    out = (m.get(p.output) & own) | (new & (own ^ 0xFFFF) & p.implemented)
    shown = (level & (drive ^ 0xFFFF)) | (out & drive & (m.get(p.analog) ^ 0xFFFF))
    changed = level ^ shown
    lazy, told = (changed & m.get(p.lazy)) != 0, m.get(p.ring_count)
    loud = ((changed & m.get(p.eager)) | (waveform_pins & drive)) != 0
    m.need(((lazy & (told >= p.ring_size)) | loud) == 0)
    following = m.now + 1
    m.put(p.before, m.select(m.get(p.changed) == following, m.get(p.before), level))
    m.put(p.constant_until, m.select(changed == 0, m.get(p.constant_until), 0))
    if is_port:
        m.put(p.port, (m.get(p.port) & (0xFFFF & ~free)) | (value & free))
    free_place = m.select(lazy, told, p.ring_size - 1)
    entry = (following << 24) | (p.number << 16) | shown
    m.put(p.ring, m.select(lazy, entry, m.get(p.ring, free_place)), free_place)
    m.put(p.ring_count, m.select(lazy, told + 1, told))
    m.put(p.lat, new)
    m.put(p.output, out)
    m.put(p.changed, following)
    m.put(p.level, shown)
    return True


def write_latch(m: Reader, p: PortOperands, value: Number, lanes: int) -> bool:
    """LAT written."""
    return _write(False, m, p, value, lanes)


def write_port(m: Reader, p: PortOperands, value: Number, lanes: int) -> bool:
    """PORT written: the latch gets the value."""
    return _write(True, m, p, value, lanes)
