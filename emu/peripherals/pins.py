"""The package's pins: the interface between the chip and its environment.

All levels are arrays in the record with one word per port (A..G = 0..6), so that a simulation reads and writes levels
without a call per pin:

- `input`: level applied from outside; `open`: 1 if nothing outside drives the pin, so that a pull-up can raise it;
- `drive`, `output`: pins driven by the chip, and their levels;
- `level`: levels at the digital input buffers (0 where the pin is analog).

A simulation that writes `input` calls `apply(port, cycle)` once afterwards, or uses `set`. A fast input (a pixel bus)
is not written edge by edge but attached as a `Waveform`, a function of the cycle.

Eager watchers (interrupts, clocks, gates) are called at the edge. Lazy watchers (motors, LEDs) are called in order, but
later. If only lazy pins change, native code may write a latch itself: it appends the new levels to `ring`, and `flush`
calls the watchers. Call `flush` before reading a result that a lazy watcher computes. Host code can replace the eager
watchers of a pin for native code (`handle_natively`).
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from functools import reduce
from operator import or_
from typing import Any, Final, Protocol

from emu.system.events import Events
from emu.system.record import Record
from emu.system.rules import Cell, Number

PORTS: Final = "ABCDEFG"
RING: Final = 256
"""Capacity of the ring: number of changes that native code can store before it must call Python."""

RingReader = Callable[[int, int], None]
"""reader(address, count): processes `count` entries of `Pins.ring`, which may be of any port."""
Watcher = Callable[[int, int, int], None]
"""watcher(cycle, changed, levels): the pins in `changed` have the given levels from `cycle` on."""


class Waveform(Protocol):
    """Levels of some pins of a port as a function of the cycle."""

    def bits(self, cycle: int) -> int:
        """Return the levels of the port's pins at `cycle`. Only bits of the attached mask count."""

    def rises(self, mask: int, after: int, until: int) -> int:
        """Return the number of rising edges of the single pin in `mask` in cycles after < c <= until."""

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        """Return the cycle of the `count`-th rising edge (1 = next) after `after` of the pin in `mask`, or NEVER."""

    def constant_until(self, cycle: int) -> int:
        """Return the first cycle after `cycle` at which `bits` may change, unless `Pins.invalidate` is called.

        Return `cycle` itself if the waveform gives no guarantee.
        """

    def changes(self, after: int, until: int) -> Iterable[tuple[int, int, int]]:
        """Return (cycle, mask, levels) for cycle `after` + 1 and for each edge in after < cycle <= until.

        Empty for a waveform that logs its edges when they occur. A recorder of all edges calls it before the waveform
        changes and at the end of each stretch of the run.
        """


class RuleWaveform(Protocol):
    """A waveform that can also compute its rising edges by a rule (emu/system/rules.py)."""

    def nth_rise_rule(self, m: Any, mask: int, after: Number, count: Number) -> Number:
        """Return `Waveform.nth_rise` as a rule expression."""


def parse_pin(name: str) -> tuple[int, int]:
    """Convert a pin name such as "RC14" to (port index, bit mask). Raises ValueError for any other text."""
    if len(name) >= 3 and name[0] == "R" and name[1] in PORTS and name[2:].isdecimal() and int(name[2:]) < 16:
        return PORTS.index(name[1]), 1 << int(name[2:])
    raise ValueError(f"{name!r} is not a pin name like RC14")


class Pins:
    """Levels and drivers of all pins, and the watchers of their edges."""

    def __init__(self, record: Record, events: Events) -> None:
        self._events: Final = events

        def words(name: str) -> memoryview[int]:
            first = record.reserve(f"pins.{name}", "H", len(PORTS)).index
            return record.u16[first : first + len(PORTS)]

        self.input: Final = words("input")
        self.open: Final = words("open")
        self.drive: Final = words("drive")
        self.output: Final = words("output")
        self.level: Final = words("level")
        self.pullup: Final = words("pullup")
        self.rule_waveforms: Final[dict[tuple[int, int], tuple[RuleWaveform, Cell]]] = {}
        """Rule waveforms by port and single-pin mask; see `add_rule_waveform`."""
        for port in range(len(PORTS)):
            self.open[port] = 0xFFFF  # no pin is connected yet
        self.analog: Final = words("analog")
        self.before: Final = words("before")
        """Previous levels. PORT reads return them in the cycle after the chip changed its outputs (§6)."""
        first = record.reserve("pins.changed", "Q", len(PORTS)).index
        self.changed: Final = record.u64[first : first + len(PORTS)]
        """First cycle of the latest output levels."""
        self.eager: Final = words("eager")
        """Pins with eager watchers. Native code must call Python when they change."""
        self.lazy: Final = words("lazy")
        """Pins that have only lazy watchers. Native code may store their changes in `ring`."""
        self.waveform_pins: Final = words("waveform_pins")
        """Pins whose levels come from an attached waveform."""
        self.constant_levels: Final = words("constant_levels")
        """Levels of the waveform pins, valid before the cycle in `constant_until`. Native code reads them."""
        first = record.reserve("pins.constant_until", "Q", len(PORTS)).index
        self.constant_until: Final = record.u64[first : first + len(PORTS)]
        self._reported: Final = words("reported")
        """Levels that were last reported to the lazy watchers."""
        ring = record.reserve("pins.ring", "Q", RING).index
        self.ring: Final = record.u64[ring : ring + RING]
        """Ring of changes made by native code, each encoded as cycle << 24 | port << 16 | levels."""
        self._ring_ports: Final = record.u8[8 * ring + 2 :]
        """From the first port in `ring`, one in each 8 bytes (the host is little-endian)."""
        self._u64: Final = record.u64
        self._count: Final = record.reserve("pins.ring_count", "Q").index
        self._logged: Final = record.reserve("pins.logged", "Q").index
        """Whether edges are logged. Native code must then call Python for edges that no watcher needs."""
        self._edges: list[tuple[int, int, int]] | None = None
        self.frames: list[tuple[int, int, int, int, int, int]] | None = None
        """Log of UART frames if set to a list; frames are then not logged as edges.

        Single levels of waveform pins are frames of length 1. An entry has: first cycle, port, pin mask, levels from
        bit 0 on, number of levels, cycles per level.
        """
        self._eager_before_log: list[int] = []
        self._native_cells: Final = record.reserve_addresses(3 * len(PORTS))
        first = self._native_cells >> 3
        self._native: Final = record.u64[first : first + 3 * len(PORTS)]
        self._handlers: Final[dict[int, tuple[int, Container[Watcher]]]] = {}
        """For each port with native edge handling: its pins, and the watchers that host code replaces."""
        self._watchers: Final[list[list[tuple[int, Watcher]]]] = [[] for _ in PORTS]
        self._lazy_watchers: Final[list[list[tuple[int, Watcher]]]] = [[] for _ in PORTS]
        self._ring_watchers: Final[list[list[tuple[int, Watcher]]]] = [[] for _ in PORTS]
        """Lazy watchers without a ring reader, which `flush` calls for each ring entry."""
        self._readers: Final[list[RingReader]] = []
        self._clean: Final = memoryview(bytes(8 * RING)).cast("Q")
        self._ring_address: Final = record.address + 8 * ring
        self.ring_addresses: Final = tuple(
            record.address + record.fields[f"pins.{name}"].offset for name in ("ring", "ring_count", "reported")
        )
        """Host addresses for a native ring reader: `ring`, the number of its entries, and each port's reported levels.

        Such a reader must clear the ring as `flush` does.
        """
        self._ports_with_ring_watchers = 0
        self._waveforms: Final[list[list[tuple[int, Waveform]]]] = [[] for _ in PORTS]
        self._on_waveform: Final[list[tuple[Callable[[int], None], Callable[[], None]]]] = []

    @property
    def edges(self) -> list[tuple[int, int, int]] | None:
        """Log of pin changes: a list that receives (cycle, port, levels); None if changes are not logged."""
        return self._edges

    @edges.setter
    def edges(self, log: list[tuple[int, int, int]] | None) -> None:
        self.flush()
        if log is not None and self._edges is None:  # for the log, every change must call Python
            self._eager_before_log = self.eager.tolist()
            for port in range(len(PORTS)):
                self.eager[port] = 0xFFFF
        elif log is None and self._edges is not None:
            for port, mask in enumerate(self._eager_before_log):
                self.eager[port] = mask
        self._edges = log
        self._u64[self._logged] = log is not None
        for port in self._handlers:
            self.resume_native(port)

    def watch(self, name: str, watcher: Watcher, *, lazy: bool = False) -> None:
        """Call `watcher` for every edge on one pin. With `lazy`, the call may happen later."""
        port, mask = parse_pin(name)
        self.watch_port(port, mask, watcher, lazy=lazy)

    def watch_port(
        self,
        port: int,
        mask: int,
        watcher: Watcher,
        *,
        lazy: bool = False,
        inputs_only: bool = False,
        reader: RingReader | None = None,
    ) -> None:
        """Call `watcher` for every edge on the pins in `mask` of a port.

        `inputs_only`: the watcher ignores pins that the port drives, so latch writes need not call it. A lazy watcher
        may have a `reader` that processes the ring entries instead.
        """
        (self._lazy_watchers if lazy else self._watchers)[port].append((mask, watcher))
        if lazy:
            self._reported[port] = self.level[port]
            if reader is not None:
                self._readers.append(reader)
            else:
                self._ring_watchers[port].append((mask, watcher))
                self._ports_with_ring_watchers |= 1 << port
        table = self.lazy if lazy else self.eager
        table[port] |= 0 if inputs_only else mask
        if port in self._handlers:
            self.resume_native(port)

    def native_cell(self, port: int) -> Cell:
        """Return the rule operand with the pins whose edges host code handles; its address and data pointer follow."""
        return Cell(self._native_cells + 24 * port, 64)

    def handle_natively(self, port: int, mask: int, replaced: Container[Watcher], code: int, data: int) -> None:
        """Let native code call host code for edges on the pins in `mask` instead of their watchers `replaced`.

        int64 code(record, data, port, changed, levels, cycle) has the arguments of a watcher. Python still handles
        pins that have any other watcher. No waveform of the port may depend on the pins. Host code may clear pins of
        `native_cell`; `resume_native` sets them again.
        """
        self._handlers[port] = mask, replaced
        self._native[3 * port + 1], self._native[3 * port + 2] = code, data
        self.resume_native(port)

    def resume_native(self, port: int) -> None:
        """Let host code handle the edges of a port again, as far as `handle_natively` allows it."""
        mask, replaced = self._handlers[port]
        watched = (pins for pins, watcher in self._watchers[port] if watcher not in replaced)
        others = reduce(or_, watched, 0xFFFF if self._edges is not None else 0)
        self._native[3 * port] = mask & ~others

    def watched_ports(self, readers: int) -> int:
        """Return a mask of the ports whose ring entries have consumers other than `readers` ring readers."""
        return self._ports_with_ring_watchers if len(self._readers) == readers else -1

    def flush(self) -> None:
        """Report the changes in the ring to the lazy watchers, then empty the ring."""
        count = self._u64[self._count]
        if not count:
            return
        self._u64[self._count] = 0
        for reader in self._readers:
            reader(self._ring_address, count)
        entries = self.ring[:count].tolist()
        ports = bytes(self._ring_ports[: 8 * count : 8])
        self.ring[:count] = self._clean[:count]
        if not any(self._ring_watchers[port] for port in set(ports)):  # readers have processed all entries
            for port in set(ports):
                self._reported[port] = entries[ports.rindex(port)] & 0xFFFF
            return
        for entry in entries:
            port = entry >> 16 & 0xFF
            watchers = self._ring_watchers[port]
            if watchers:
                self._notify_lazy(entry >> 24, port, entry & 0xFFFF, watchers)
            else:
                self._reported[port] = entry & 0xFFFF

    def _notify_lazy(self, cycle: int, port: int, level: int, watchers: list[tuple[int, Watcher]]) -> None:
        changed = self._reported[port] ^ level
        self._reported[port] = level
        for mask, watcher in watchers:
            if changed & mask:
                watcher(cycle, changed & mask, level)

    def attach(self, port: int, mask: int, waveform: Waveform) -> None:
        """Let `waveform` supply the levels of the pins in `mask`. Its edges do not call watchers."""
        if all(entry[1] is not waveform for entry in self._waveforms[port]):
            self._waveforms[port].append((mask, waveform))
            self._update_waveform_pins(port)

    def add_rule_waveform(self, port: int, mask: int, waveform: RuleWaveform, attached: Cell) -> None:
        """Register a rule waveform for the pins in `mask`. It applies while the number in cell `attached` is not 0."""
        for bit in range(16):
            if mask >> bit & 1:
                self.rule_waveforms[port, 1 << bit] = (waveform, attached)

    def detach(self, port: int, waveform: Waveform) -> None:
        """Remove an attached waveform."""
        self._waveforms[port] = [entry for entry in self._waveforms[port] if entry[1] is not waveform]
        self._update_waveform_pins(port)

    def _update_waveform_pins(self, port: int) -> None:
        """Recompute the set of waveform pins of `port`. After a restore the record already holds it."""
        mask_of_all = 0
        for mask, _waveform in self._waveforms[port]:
            mask_of_all |= mask
        if mask_of_all != self.waveform_pins[port]:
            self.waveform_pins[port] = mask_of_all
            self.invalidate(port)

    def waveform(self, port: int, mask: int) -> Waveform | None:
        """Return the waveform attached to the pins in `mask`, None if there is none."""
        return next((wave for pins, wave in self._waveforms[port] if pins & mask), None)

    def on_waveform_change(self, before: Callable[[int], None], after: Callable[[], None]) -> Callable[[], None]:
        """Call `before(cycle)` and `after()` around every `change_waveform`. Return a function that stops the calls."""
        entry = (before, after)
        self._on_waveform.append(entry)
        return lambda: self._on_waveform.remove(entry)

    def log_level(self, cycle: int, port: int, mask: int, levels: int) -> None:
        """Append the levels of waveform pins from `cycle` on to the log of frames or of edges, if there is one."""
        if self.frames is not None:
            self.frames += [(cycle, port, 1 << bit, levels >> bit & 1, 1, 1) for bit in range(16) if mask >> bit & 1]
        elif self._edges is not None:
            self._edges.append((cycle, port, self.level[port] & ~mask | levels & mask))

    def log_waveforms(self, after: int, until: int) -> None:
        """Log the edges in after < cycle <= until of waveforms that do not log them when they occur."""
        for port, waveforms in enumerate(self._waveforms):
            for mask, waveform in waveforms:
                for cycle, pins, levels in waveform.changes(after, until):
                    self.log_level(cycle, port, pins & mask, levels)

    def change_waveform(self, cycle: int, change: Callable[[], None]) -> None:
        """Run `change`, which alters an attached waveform from `cycle` on. Timers clocked by it keep their counts."""
        for before, _ in self._on_waveform:
            before(cycle)
        change()
        for port in range(len(PORTS)):
            self.invalidate(port)
        for _, after in self._on_waveform:
            after()

    def invalidate(self, port: int) -> None:
        """Discard the cached levels of `port`, after its waveforms or the state on which they depend changed."""
        self.constant_until[port] = self.constant_levels[port] = 0

    def set(self, name: str, level: int, cycle: int | None = None) -> None:
        """Drive one pin from outside with `level` (0 or 1) from `cycle` on (default: now)."""
        port, mask = parse_pin(name)
        self.set_port(port, mask, mask if level else 0, cycle)

    def set_port(self, port: int, mask: int, levels: int, cycle: int | None = None) -> None:
        """Drive the pins in `mask` of a port from outside, from `cycle` on (default: now)."""
        self.input[port] = self.input[port] & ~mask | levels & mask
        self.open[port] &= ~mask
        self.apply(port, self._events.now if cycle is None else cycle)

    def release(self, name: str, cycle: int | None = None) -> None:
        """Stop driving one pin from outside."""
        port, mask = parse_pin(name)
        self.open[port] |= mask
        self.input[port] &= ~mask
        self.apply(port, self._events.now if cycle is None else cycle)

    def get(self, name: str) -> int:
        """Return the level of one pin in the current cycle, 0 or 1."""
        port, mask = parse_pin(name)
        return int(bool(self._events.peek(lambda: self.levels(port, self._events.now)) & mask))

    def levels(self, port: int, cycle: int) -> int:
        """Return the digital levels of a port at `cycle`: the current one; any cycle for waveform pins."""
        return self._with_waveforms(port, cycle, self.level[port])

    def _with_waveforms(self, port: int, cycle: int, level: int) -> int:
        for mask, waveform in self._waveforms[port]:
            level = level & ~mask | waveform.bits(cycle) & mask
        return level

    def read_port(self, port: int, cycle: int) -> int:
        """Return the value that an instruction reads from PORT at `cycle`; outputs appear one cycle late (§6)."""
        level = (self.before if cycle <= self.changed[port] else self.level)[port]
        from_waveform = self.waveform_pins[port]
        if not from_waveform:
            return level
        if cycle < self.constant_until[port]:
            return level & ~from_waveform | self.constant_levels[port]
        waveforms = self._waveforms[port]
        if len(waveforms) == 1:
            ((mask, wave),) = waveforms
            waved, until = wave.bits(cycle) & mask, wave.constant_until(cycle)
        else:
            waved = self._with_waveforms(port, cycle, 0)
            until = min(wave.constant_until(cycle) for _, wave in waveforms)
        if until > cycle:
            self.constant_levels[port], self.constant_until[port] = waved, until
        return level & ~from_waveform | waved

    def apply(self, port: int, cycle: int, by_chip: bool = False) -> None:
        """Recompute a port's levels after a change of any of the arrays. The new levels apply from `cycle` on."""
        outside = self.input[port] | self.pullup[port] & self.open[port]
        drive = self.drive[port]
        level = (self.output[port] & drive | outside & ~drive) & ~self.analog[port]
        old = self.level[port]
        if by_chip and cycle != self.changed[port]:
            self.before[port] = old
            self.changed[port] = cycle
        changed = old ^ level
        if not changed:
            return
        self.level[port] = level
        self.invalidate(port)
        if self._edges is not None and not self._events.quiet:
            self._edges.append((cycle, port, level))
        if self._lazy_watchers[port]:
            self.flush()
            self._notify_lazy(cycle, port, level, self._lazy_watchers[port])
        for mask, watcher in self._watchers[port]:
            if changed & mask:
                watcher(cycle, changed & mask, level)
