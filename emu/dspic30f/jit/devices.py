"""Registers of devices that native code reads and writes by itself, from what the devices keep in the record.

The formulas are those of emu/peripherals/README.md and emu/boards/README.md; whatever they do not cover leaves through
the slow exit, before anything is done, and the device itself answers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

from emu.dspic30f.core import Core
from emu.dspic30f.jit.converter import Switch, converter_of
from emu.dspic30f.jit.values import Number, Value, wide
from emu.dspic30f.jit.variables import pointer

if TYPE_CHECKING:
    from emu.dspic30f.jit.builder import LlvmBuilder

PORTS: Final = "ABCDEFG"
TIME_BASES: Final = (2, 3)
"""Timers that output compares may plan by (dspic30f6014a.md §9)."""


class NativeRegister(Protocol):
    """A register with native accesses; None: that access is the device's."""

    def read(self, b: LlvmBuilder) -> Number | None:
        """The word an instruction reads in cycle `b.now`."""

    def write(self, b: LlvmBuilder, value: Number, lanes: int) -> bool:
        """Queue the write of the bits in `lanes`; False: not native."""


def _load(b: LlvmBuilder, offset: int, bits: int) -> Value:
    return b.e.load(pointer(b.e, offset), bits)


def _store(b: LlvmBuilder, offset: int, value: Number, bits: int) -> None:
    b.e.store(pointer(b.e, offset), value, bits)


def _divide(b: LlvmBuilder, op: str, left: Number, right: Number) -> Value:
    return b.e.let(f"{op} i64 {wide(left)}, {wide(right)}")


@dataclass(frozen=True)
class TimerPlaces:
    """Byte offsets in the record of one timer's registers and cells."""

    tmr: int
    pr: int
    con: int
    wide_bit: int
    base: int
    tick: int
    period: int
    due: int
    deadline: int
    before: int
    phase: int
    clear_from: int
    clear_until: int
    clear_due: int
    planners: tuple[int, ...]
    """Control registers of the devices that plan by this timer: while all are 0, nobody need be told of changes."""


@dataclass(frozen=True)
class Count:
    """TMRx: a function of the cycle."""

    timer: TimerPlaces

    def read(self, b: LlvmBuilder) -> Number | None:
        """(stored + ticks since base) modulo (PR + 1), while the stored count is not above PR."""
        t = self.timer
        tick, stored, top = _load(b, t.tick, 32), _load(b, t.tmr, 16), _load(b, t.pr, 16)
        b.guard((tick != 0) & (stored <= top) & ((_load(b, t.con, 16) & t.wide_bit) == 0))
        passed = b.now - _load(b, t.base, 64)
        clocks = b.select(passed < 0, 0, passed)
        return _divide(b, "urem", stored + _divide(b, "udiv", clocks, tick), top + 1)

    def write(self, b: LlvmBuilder, value: Number, lanes: int) -> bool:
        """The written count stands from the next cycle, with an empty prescaler."""
        t = self.timer
        if lanes != 0xFFFF:
            return False
        if isinstance(value, int) and value == 0:
            self._clear(b)
            return True
        _guard_alone(b, t)
        tick, limit = _load(b, t.tick, 32), _load(b, t.pr, 16)
        b.guard((_load(b, t.period, 64) != 0) & (limit != 0))
        due = _load(b, t.due, 64)
        _replan(b, t, tick, limit, value & 0xFFFF, b.now + 1, due == b.now + 1)
        return True

    def _clear(self, b: LlvmBuilder) -> None:
        """Either a plain periodic timer, or one whose device has foretold what clearing leads to."""
        t = self.timer
        _guard_alone(b, t)
        tick, limit, period = _load(b, t.tick, 32), _load(b, t.pr, 16), _load(b, t.period, 64)
        plain = (period != 0) & (limit != 0)
        due = _load(b, t.due, 64)
        until = _load(b, t.clear_until, 64)
        early = b.e.let(f"icmp ult i64 {wide(b.now)}, {until.text}", bit=True)
        foretold = early & (_load(b, t.clear_from, 64) <= b.now) & (due != b.now + 1)
        b.guard(plain | foretold)
        stands = plain & (due == b.now + 1)
        next_due = b.select(foretold, _load(b, t.clear_due, 64), b.now + 1 + limit * tick + 1)
        next_due = b.select(stands, due, next_due)

        def commit() -> None:
            _store(b, t.tmr, 0, 16)
            _store(b, t.base, b.now + 1, 64)
            _store(b, t.before, b.select(foretold, 0, _load(b, t.before, 32)), 32)
            _store(b, t.phase, b.select(foretold, 0, _load(b, t.phase, 16)), 16)
            _store(b, t.period, b.select(foretold | stands, 0, (limit + 1) * tick), 64)
            _post(b, t, next_due)

        b.pending.stores.append(commit)
        b.pending.replanned = True


@dataclass(frozen=True)
class Period:
    """PRx of a plainly running timer: count up to the next cycle with the old period, post the match anew."""

    timer: TimerPlaces

    def read(self, b: LlvmBuilder) -> Number | None:
        """Plain storage."""
        return _load(b, self.timer.pr, 16)

    def write(self, b: LlvmBuilder, value: Number, lanes: int) -> bool:
        """Stands from the next cycle."""
        t = self.timer
        if lanes != 0xFFFF:
            return False
        _guard_alone(b, t)
        limit = value & 0xFFFF
        tick, stored, old = _load(b, t.tick, 32), _load(b, t.tmr, 16), _load(b, t.pr, 16)
        base, next_cycle = _load(b, t.base, 64), b.now + 1
        b.guard((_load(b, t.period, 64) != 0) & (limit != 0) & (stored <= old) & (base <= next_cycle))
        safe = b.select(tick == 0, 1, tick)
        passed = next_cycle - base
        start = _divide(b, "urem", stored + _divide(b, "udiv", passed, safe), old + 1)
        due = _load(b, t.due, 64)
        stands = (due == next_cycle) | ((due == b.now + 2) & (start == limit))
        _replan(b, t, tick, limit, start, next_cycle - _divide(b, "urem", passed, safe), stands)
        b.pending.stores.append(lambda: _store(b, t.pr, limit, 16))
        return True


def _guard_alone(b: LlvmBuilder, t: TimerPlaces) -> None:
    users: Number = 0
    for address in t.planners:
        users = users | _load(b, address, 16)
    b.guard(users == 0)


def _replan(
    b: LlvmBuilder, t: TimerPlaces, tick: Value, limit: Number, start: Number, base: Number, stands: Value
) -> None:
    """As Timer._replan_simply: the count is `start` at cycle `base`; a match that `stands` happens as posted."""
    ahead = b.select(start > limit, 0x10000 - start + limit, b.select(start < limit, limit - start, limit + 1))
    due = b.select(stands, _load(b, t.due, 64), base + ahead * tick + 1)

    def commit() -> None:
        _store(b, t.tmr, start, 16)
        _store(b, t.base, base, 64)
        _store(b, t.period, b.select(stands, 0, (limit + 1) * tick), 64)
        _post(b, t, due)

    b.pending.stores.append(commit)
    b.pending.replanned = True


def _post(b: LlvmBuilder, t: TimerPlaces, due: Number) -> None:
    _store(b, t.due, due, 64)
    deadline = _load(b, t.deadline, 64)
    _store(b, t.deadline, b.e.let(f"call i64 @llvm.umin.i64(i64 {wide(deadline)}, i64 {wide(due)})"), 64)


@dataclass(frozen=True)
class PortPlaces:
    """Byte offsets of one port's words in the pins' arrays."""

    number: int
    lat: int
    port: int
    owned: int
    output: int
    level: int
    drive: int
    analog: int
    eager: int
    lazy: int
    before: int
    waving: int
    standing: int
    stands_until: int
    changed: int
    ring: int
    ring_count: int
    ring_size: int
    implemented: int


@dataclass(frozen=True)
class PixelBus:
    """A port byte that a camera drives: `line` stands on it from `line_from` to `line_to`."""

    mask: int
    shift: int
    line_from: int
    line_to: int
    line: int
    byte_tcy: int
    byte_tcy_bits: int


@dataclass(frozen=True)
class Latch:
    """LATx, or PORTx when written: drives pins that only lazy watchers look at."""

    port: PortPlaces
    is_port: bool
    bus: PixelBus | None = None

    def read(self, b: LlvmBuilder) -> Number | None:
        """LAT is storage; PORT shows the pins, outputs one cycle late."""
        p = self.port
        if not self.is_port:
            return _load(b, p.lat, 16)
        late = b.now <= _load(b, p.changed, 64)
        levels = b.select(late, _load(b, p.before, 16), _load(b, p.level, 16))
        waving = _load(b, p.waving, 16)
        stands = b.e.let(f"icmp ult i64 {wide(b.now)}, {_load(b, p.stands_until, 64).text}", bit=True)
        if self.bus is None:
            b.guard(stands | (waving == 0))
        else:
            shown, on_line = self._pixels(b, levels, self.bus)
            b.guard(stands | (on_line & ((waving & (0xFFFF & ~self.bus.mask)) == 0)) | (waving == 0))
        levels = (levels & (waving ^ 0xFFFF)) | (_load(b, p.standing, 16) & waving)
        return levels if self.bus is None else b.select(on_line & (stands ^ 1) & (waving != 0), shown, levels)

    def _pixels(self, b: LlvmBuilder, levels: Number, bus: PixelBus) -> tuple[Number, Number]:
        """The port with the byte that is on the bus, and whether one is."""
        first, end = _load(b, bus.line_from, 64), _load(b, bus.line_to, 64)
        on_line = (b.now >= first) & (b.now < end)
        width = _load(b, bus.byte_tcy, bus.byte_tcy_bits)
        passed = b.select(on_line, b.now - first, 0)
        index = _divide(b, "udiv", passed, b.select(width == 0, 1, width))
        pixel = b.e.load(pointer(b.e, index + bus.line), 8)
        return (levels & (0xFFFF & ~bus.mask)) | (pixel << bus.shift), on_line

    def write(self, b: LlvmBuilder, value: Number, lanes: int) -> bool:
        """New levels from the next cycle on."""
        p = self.port
        free = p.implemented & lanes
        old = _load(b, p.lat, 16)
        new = (old & (0xFFFF & ~free)) | (value & free)
        own, output, drive = _load(b, p.owned, 16), _load(b, p.output, 16), _load(b, p.drive, 16)
        level, analog = _load(b, p.level, 16), _load(b, p.analog, 16)
        out = (output & own) | (new & (own ^ 0xFFFF) & p.implemented)
        shown = (level & (drive ^ 0xFFFF)) | (out & drive & (analog ^ 0xFFFF))
        changed = level ^ shown
        lazy = (changed & _load(b, p.lazy, 16)) != 0
        count = _load(b, p.ring_count, 64)
        full = lazy & (count >= p.ring_size)
        loud = ((changed & _load(b, p.eager, 16)) | (_load(b, p.waving, 16) & drive)) != 0
        b.guard((full | loud) == 0)
        cycle = b.now + 1

        def commit() -> None:
            _store(b, p.lat, new, 16)
            if self.is_port:
                _store(b, p.port, (_load(b, p.port, 16) & (0xFFFF & ~free)) | (value & free), 16)
            _store(b, p.output, out, 16)
            moment = _load(b, p.changed, 64)
            again = moment == cycle
            _store(b, p.before, b.select(again, _load(b, p.before, 16), level), 16)
            _store(b, p.changed, cycle, 64)
            _store(b, p.level, shown, 16)
            slot = b.select(lazy, count, p.ring_size - 1)
            place = p.ring + (slot << 3)
            kept = b.e.load(pointer(b.e, place), 64)
            entry = (cycle << 24) | (p.number << 16) | shown
            b.e.store(pointer(b.e, place), b.select(lazy, entry, kept), 64)
            _store(b, p.ring_count, count + b.select(lazy, 1, 0), 64)

        b.pending.stores.append(commit)
        return True


@dataclass(frozen=True)
class Standing:
    """A register its device changes by itself, but not before a cycle it has published."""

    address: int
    until: int

    def read(self, b: LlvmBuilder) -> Number | None:
        """What is stored, until then."""
        b.guard(b.now < _load(b, self.until, 64))
        return _load(b, self.address, 16)

    def write(self, b: LlvmBuilder, value: Number, lanes: int) -> bool:
        """The device's."""
        return False


def native_registers(core: Core) -> dict[int, NativeRegister]:
    """What can be native on this machine, by even SFR address, from the fields its devices have reserved."""
    registers: dict[int, NativeRegister] = {}
    _timers(core, registers)
    if "pins.level" in core.record.fields:
        _ports(core, registers)
    if "adc.stands_until" in core.record.fields:
        until, sfrs = core.record.fields["adc.stands_until"].offset, core.chip.sfrs
        for name in ("ADCON1", "ADCON2", *(f"ADCBUF{index:X}" for index in range(16))):
            registers[sfrs[name].address] = Standing(sfrs[name].address, until)
    converter = converter_of(core)
    if converter is not None:
        registers[converter.con1] = Switch(converter)
    return registers


def _timers(core: Core, registers: dict[int, NativeRegister]) -> None:
    fields, sfrs, names = core.record.fields, core.chip.sfrs, core.events.names
    planners = tuple(sfrs[f"OC{site.number}CON"].address for site in core.chip.compares)
    for site in core.chip.timers:
        n = site.number
        if f"t{n}.match" not in names or fields[f"t{n}.tick"].kind != "I":
            continue
        con = sfrs[f"T{n}CON"]
        wide_bit = 1 << con.fields["T32"][0] if "T32" in con.fields else 0
        places = TimerPlaces(
            sfrs[f"TMR{n}"].address, sfrs[f"PR{n}"].address, con.address, wide_bit, fields[f"t{n}.base"].offset,
            fields[f"t{n}.tick"].offset, fields[f"t{n}.period"].offset,
            fields["events.due"].offset + 8 * names.index(f"t{n}.match"), fields["events.deadline"].offset,
            fields[f"t{n}.before"].offset, fields[f"t{n}.phase"].offset, fields[f"t{n}.clear_from"].offset,
            fields[f"t{n}.clear_until"].offset, fields[f"t{n}.clear_due"].offset,
            planners if n in TIME_BASES else ())
        registers[places.tmr] = Count(places)
        registers[places.pr] = Period(places)


def _ports(core: Core, registers: dict[int, NativeRegister]) -> None:
    fields, sfrs = core.record.fields, core.chip.sfrs
    for number, letter in enumerate(PORTS):
        if f"LAT{letter}" not in sfrs or f"port{letter}.owned" not in fields:
            continue

        def word(name: str, index: int = number) -> int:
            return fields[f"pins.{name}"].offset + 2 * index

        lat = sfrs[f"LAT{letter}"]
        places = PortPlaces(
            number, lat.address, sfrs[f"PORT{letter}"].address, fields[f"port{letter}.owned"].offset,
            word("output"), word("level"), word("drive"), word("analog"), word("eager"), word("lazy"), word("before"),
            word("waving"), word("standing"), fields["pins.stands_until"].offset + 8 * number,
            fields["pins.changed"].offset + 8 * number, fields["pins.ring"].offset, fields["pins.ring_count"].offset,
            fields["pins.ring"].count, lat.writable)
        registers[lat.address] = Latch(places, is_port=False)
        registers[sfrs[f"PORT{letter}"].address] = Latch(places, is_port=True, bus=_pixel_bus(core, letter))


def _pixel_bus(core: Core, letter: str) -> PixelBus | None:
    """The camera's bus, which stands on RD8-RD15 of the e-puck (epuck.md)."""
    fields = core.record.fields
    if letter != "D" or "camera.line" not in fields:
        return None
    width = fields["camera.line_byte_tcy"]
    return PixelBus(0xFF00, 8, fields["camera.line_from"].offset, fields["camera.line_to"].offset,
                    fields["camera.line"].offset, width.offset, {"B": 8, "H": 16, "I": 32, "Q": 64}[width.kind])
