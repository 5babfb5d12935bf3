"""Rules of a port (§6): writes of LAT and PORT that affect no eager watcher in Python, and reads of PORT."""

from __future__ import annotations

from dataclasses import dataclass

from emu.system.rules import Cell, Number, RuleBuilder


@dataclass(frozen=True, slots=True)
class ByteStream:
    """Bytes in the record that appear on pins of one port: byte k from cycle `begin` + k * `width` on."""

    mask: int
    shift: int
    begin: Cell
    end: Cell
    first: Cell
    width: Cell


@dataclass(frozen=True, slots=True)
class PortOperands:
    """Operands of a port's rules: its registers, and its words in the arrays of `pins.py`."""

    number: int
    implemented: int
    lat: Cell
    port: Cell
    owned: Cell
    output: Cell
    level: Cell
    drive: Cell
    analog: Cell
    eager: Cell
    native: Cell
    """Cell of the pins whose edges host code handles; the next two hold its address and its data pointer."""
    lazy: Cell
    before: Cell
    waveform_pins: Cell
    constant_levels: Cell
    constant_until: Cell
    changed: Cell
    ring: Cell
    ring_size: int
    ring_count: Cell
    byte_stream: ByteStream | None = None


def read_port(m: RuleBuilder, p: PortOperands) -> Number:
    """Return the pin levels, on which outputs appear one cycle late.

    The rule requires that each waveform on the port is constant or the byte stream.
    """
    levels = m.select(m.now <= m.get(p.changed), m.get(p.before), m.get(p.level))
    waveform_pins = m.get(p.waveform_pins)
    is_constant = m.below(m.now, m.get(p.constant_until)) | (waveform_pins == 0)
    constant_levels = (levels & (waveform_pins ^ 0xFFFF)) | (m.get(p.constant_levels) & waveform_pins)
    if p.byte_stream is None:
        m.require(is_constant)
        return constant_levels
    s = p.byte_stream
    begin, width = m.get(s.begin), m.get(s.width)
    inside = (m.now >= begin) & (m.now < m.get(s.end)) & ((waveform_pins & (0xFFFF & ~s.mask)) == 0)
    m.require(is_constant | inside)
    place = m.div(m.select(inside, m.now - begin, 0), m.select(width == 0, 1, width))
    shown = (levels & (0xFFFF & ~s.mask)) | (m.get(s.first, place) << s.shift)
    return m.select(is_constant, constant_levels, shown)


def _write(is_port: bool, m: RuleBuilder, p: PortOperands, value: Number, lanes: int) -> bool:
    """Write the latch. The new levels apply from the next cycle on; changes of lazy pins are added to the ring."""
    free = p.implemented & lanes
    new = (m.get(p.lat) & (0xFFFF & ~free)) | (value & free)
    own, drive, level = m.get(p.owned), m.get(p.drive), m.get(p.level)
    out = (m.get(p.output) & own) | (new & (own ^ 0xFFFF) & p.implemented)
    shown = (level & (drive ^ 0xFFFF)) | (out & drive & (m.get(p.analog) ^ 0xFFFF))
    changed = level ^ shown
    lazy, used = (changed & m.get(p.lazy)) != 0, m.get(p.ring_count)
    native, code, data = changed & m.get(p.native), m.get(p.native, 1), m.get(p.native, 2)
    needs_python = (changed & m.get(p.eager) & (native ^ 0xFFFF)) != 0
    m.require((((lazy & (used >= p.ring_size)) | needs_python) == 0) & ((native == 0) | m.can_call(code)))
    following = m.now + 1
    m.put(p.before, m.select(m.get(p.changed) == following, m.get(p.before), level))
    m.put(p.constant_until, m.select(changed == native, m.get(p.constant_until), 0))
    if is_port:
        m.put(p.port, (m.get(p.port) & (0xFFFF & ~free)) | (value & free))
    free_place = m.select(lazy, used, p.ring_size - 1)
    entry = (following << 24) | (p.number << 16) | shown
    m.put(p.ring, m.select(lazy, entry, m.get(p.ring, free_place)), free_place)
    m.put(p.ring_count, m.select(lazy, used + 1, used))
    m.put(p.lat, new)
    m.put(p.output, out)
    m.put(p.changed, following)
    m.put(p.level, shown)
    m.notify(native != 0, code, data, p.number, native, shown, following)
    return True


def write_latch(m: RuleBuilder, p: PortOperands, value: Number, lanes: int) -> bool:
    """Write LAT, if no eager watcher in Python is affected."""
    return _write(False, m, p, value, lanes)


def write_port(m: RuleBuilder, p: PortOperands, value: Number, lanes: int) -> bool:
    """Write PORT, which writes the latch."""
    return _write(True, m, p, value, lanes)
