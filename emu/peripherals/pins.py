"""The package pins: the interface between the chip and the world around it.

Everything is an array in the record with one word per port (A..G = 0..6), so a simulation reads and writes levels
without calls per pin:

- `input`: level the outside applies; `open`: 1 where nothing outside drives the pin low, so that a pull-up can lift it;
- `drive`, `output`: what the chip drives, and with which level;
- `level`: what the digital input buffers see (0 where the pin is analog).

A simulation that writes `input` calls `apply(port, cycle)` once afterwards, or uses `set`. A fast input (a pixel bus)
is not pushed edge by edge: it is attached as a `Waveform`, a function of the cycle.

Watchers of pins are eager (told at once: interrupts, clocks, gates) or lazy (told in order, some time later: motors,
LEDs). Native code may write a latch by itself as long as only lazy pins change; it leaves the new levels in `ring`, and
`flush` tells. Whoever reports what a lazy watcher has counted calls `flush` first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, Protocol

from emu.system.events import Events
from emu.system.record import Record
from emu.system.rules import Number, Place

PORTS: Final = "ABCDEFG"
RING: Final = 256
"""Changes native code can leave behind before it must call Python."""

RingReader = Callable[[int, int], None]
"""Called as reader(address, count) with so many changes as native code leaves them in `Pins.ring`, of any port."""
Watcher = Callable[[int, int, int], None]
"""Called as watcher(cycle, changed, levels): pins in `changed` have the given levels from `cycle` on."""


class Waveform(Protocol):
    """Levels of some pins of one port as a function of the cycle."""

    def bits(self, cycle: int) -> int:
        """Levels of the port's pins in `cycle`; only bits of the attached mask count."""

    def rises(self, mask: int, after: int, until: int) -> int:
        """Number of rising edges of the one pin in `mask` in cycles after < c <= until."""

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        """Cycle of the `count`-th rising edge (1 = next) of the pin in `mask` behind cycle `after`, or NEVER."""

    def constant_until(self, cycle: int) -> int:
        """First cycle behind `cycle` in which `bits` may differ from those in `cycle`, if nobody calls
        `Pins.invalidate`; `cycle` itself if nothing is promised."""


class RuleWaveform(Protocol):
    """A waveform that also says as text for every engine (emu/system/rules.py) when it rises."""

    def nth_rise_rule(self, m: Any, mask: int, after: Number, count: Number) -> Number:
        """`Waveform.nth_rise`."""


def parse_pin(name: str) -> tuple[int, int]:
    """("RC14") -> (port index, bit mask). Raises ValueError for anything that is not a pin name."""
    if len(name) >= 3 and name[0] == "R" and name[1] in PORTS and name[2:].isdecimal() and int(name[2:]) < 16:
        return PORTS.index(name[1]), 1 << int(name[2:])
    raise ValueError(f"{name!r} is not a pin name like RC14")


class Pins:
    """Levels of all pins, who drives them, and who wants to hear of edges."""

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
        self.described: Final[dict[tuple[int, int], tuple[RuleWaveform, Place]]] = {}
        """By port and mask of one pin; see `describe`."""
        for port in range(len(PORTS)):
            self.open[port] = 0xFFFF  # nothing is connected yet
        self.analog: Final = words("analog")
        self.before: Final = words("before")
        """What PORT reads still return in the cycle after the chip changed its outputs (§6)."""
        first = record.reserve("pins.changed", "Q", len(PORTS)).index
        self.changed: Final = record.u64[first : first + len(PORTS)]
        """First cycle of the newest output levels."""
        self.eager: Final = words("eager")
        """Pins whose changes Python must hear of at once."""
        self.lazy: Final = words("lazy")
        """Pins whose changes may wait in `ring`."""
        self.waveform_pins: Final = words("waveform_pins")
        """Pins whose levels an attached waveform supplies."""
        self.constant_levels: Final = words("constant_levels")
        """Levels of the waveform_pins pins that hold before the cycle in `constant_until`, so that native code can read them."""
        first = record.reserve("pins.constant_until", "Q", len(PORTS)).index
        self.constant_until: Final = record.u64[first : first + len(PORTS)]
        self._told: Final = words("told")
        """Levels the lazy watchers know."""
        ring = record.reserve("pins.ring", "Q", RING).index
        self.ring: Final = record.u64[ring : ring + RING]
        """Changes made by native code: cycle << 24 | port << 16 | levels."""
        self._u64: Final = record.u64
        self._count: Final = record.reserve("pins.ring_count", "Q").index
        self._edges: list[tuple[int, int, int]] | None = None
        self.frames: list[tuple[int, int, int, int, int, int]] | None = None
        """Set to a list to have the frames of UARTs there instead of among the edges: first cycle, port, mask of the
        pin, levels from bit 0 on, how many, cycles of one."""
        self._eager_before_log: list[int] = []
        self._watchers: Final[list[list[tuple[int, Watcher]]]] = [[] for _ in PORTS]
        self._lazy_watchers: Final[list[list[tuple[int, Watcher]]]] = [[] for _ in PORTS]
        self._ring_watchers: Final[list[list[tuple[int, Watcher]]]] = [[] for _ in PORTS]
        """Lazy watchers that are told what is in the ring; the others read it."""
        self._readers: Final[list[RingReader]] = []
        self._clean: Final = memoryview(bytes(8 * RING)).cast("Q")
        self._ring_address: Final = record.address + 8 * ring
        self.ring_addresses: Final = tuple(
            record.address + record.fields[f"pins.{name}"].offset for name in ("ring", "ring_count", "told")
        )
        """Addresses of the host, for a reader that is compiled code: `ring`, how many changes are in it, and the levels
        of each port that have been told; whoever reads leaves the ring clean as `flush` does."""
        self._heard = 0
        self._waveforms: Final[list[list[tuple[int, Waveform]]]] = [[] for _ in PORTS]
        self._on_waveform: Final[list[tuple[Callable[[int], None], Callable[[], None]]]] = []

    @property
    def edges(self) -> list[tuple[int, int, int]] | None:
        """Set to a list to log (cycle, port, levels) at every change, to None to stop."""
        return self._edges

    @edges.setter
    def edges(self, log: list[tuple[int, int, int]] | None) -> None:
        self.flush()
        if log is not None and self._edges is None:  # every change must come by
            self._eager_before_log = self.eager.tolist()
            for port in range(len(PORTS)):
                self.eager[port] = 0xFFFF
        elif log is None and self._edges is not None:
            for port, mask in enumerate(self._eager_before_log):
                self.eager[port] = mask
        self._edges = log

    def watch(self, name: str, watcher: Watcher, *, lazy: bool = False) -> None:
        """Tell `watcher` of every edge on one pin; `lazy`: not necessarily at once."""
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
        """Tell `watcher` of every edge on the pins in `mask` of a port.

        `inputs_only`: it ignores edges on pins the port drives, so latch writes need not come by. A lazy watcher may
        have a `reader`, which is given what native code has done instead.
        """
        (self._lazy_watchers if lazy else self._watchers)[port].append((mask, watcher))
        if lazy:
            self._told[port] = self.level[port]
            if reader is not None:
                self._readers.append(reader)
            else:
                self._ring_watchers[port].append((mask, watcher))
                self._heard |= 1 << port
        table = self.lazy if lazy else self.eager
        table[port] |= 0 if inputs_only else mask

    def watched_ports(self, readers: int) -> int:
        """Bit n: what the ring has of port n is to be told to somebody else than so many readers, who ask."""
        return self._heard if len(self._readers) == readers else -1

    def flush(self) -> None:
        """Tell the lazy watchers what native code has done to the pins. The ring is left clean, as if never used."""
        count = self._u64[self._count]
        if not count:
            return
        self._u64[self._count] = 0
        for reader in self._readers:
            reader(self._ring_address, count)
        entries = self.ring[:count].tolist()
        self.ring[:count] = self._clean[:count]
        for entry in entries:
            port = entry >> 16 & 0xFF
            watchers = self._ring_watchers[port]
            if watchers:
                self._tell_lazy(entry >> 24, port, entry & 0xFFFF, watchers)
            else:
                self._told[port] = entry & 0xFFFF

    def _tell_lazy(self, cycle: int, port: int, level: int, watchers: list[tuple[int, Watcher]]) -> None:
        changed = self._told[port] ^ level
        self._told[port] = level
        for mask, watcher in watchers:
            if changed & mask:
                watcher(cycle, changed & mask, level)

    def attach(self, port: int, mask: int, waveform: Waveform) -> None:
        """Let a function of the cycle supply the levels of the pins in `mask`; edge watchers do not hear of them."""
        if all(entry[1] is not waveform for entry in self._waveforms[port]):
            self._waveforms[port].append((mask, waveform))
            self._wave(port)

    def describe(self, port: int, mask: int, waveform: RuleWaveform, attached: Place) -> None:
        """While the number at `attached` is not 0, the waveform on the pins in `mask` is this one."""
        for bit in range(16):
            if mask >> bit & 1:
                self.described[port, 1 << bit] = (waveform, attached)

    def detach(self, port: int, waveform: Waveform) -> None:
        """Undo `attach`."""
        self._waveforms[port] = [entry for entry in self._waveforms[port] if entry[1] is not waveform]
        self._wave(port)

    def _wave(self, port: int) -> None:
        """The set of waveform_pins pins of `port` follows the list; after a restore the record has it already."""
        waveform_pins = 0
        for mask, _waveform in self._waveforms[port]:
            waveform_pins |= mask
        if waveform_pins != self.waveform_pins[port]:
            self.waveform_pins[port] = waveform_pins
            self.invalidate(port)

    def waveform(self, port: int, mask: int) -> Waveform | None:
        """The waveform on the pins in `mask`, if one is attached."""
        return next((wave for pins, wave in self._waveforms[port] if pins & mask), None)

    def on_waveform_change(self, before: Callable[[int], None], after: Callable[[], None]) -> None:
        """Have `before(cycle)` and `after()` called around every change of a waveform's future."""
        self._on_waveform.append((before, after))

    def change_waveform(self, cycle: int, change: Callable[[], None]) -> None:
        """Run `change`, which gives an attached waveform a new future from `cycle` on; clocks keep their counts."""
        for before, _ in self._on_waveform:
            before(cycle)
        change()
        for port in range(len(PORTS)):
            self.invalidate(port)
        for _, after in self._on_waveform:
            after()

    def invalidate(self, port: int) -> None:
        """A waveform on `port` has got a new future, or what it depends on has changed: forget what it promised."""
        self.constant_until[port] = 0

    def set(self, name: str, level: int, cycle: int | None = None) -> None:
        """The outside drives one pin with `level` (0 or 1) from `cycle` on (default: now)."""
        port, mask = parse_pin(name)
        self.set_port(port, mask, mask if level else 0, cycle)

    def set_port(self, port: int, mask: int, levels: int, cycle: int | None = None) -> None:
        """The outside drives the pins in `mask` of a port."""
        self.input[port] = self.input[port] & ~mask | levels & mask
        self.open[port] &= ~mask
        self.apply(port, self._events.now if cycle is None else cycle)

    def release(self, name: str, cycle: int | None = None) -> None:
        """The outside lets go of one pin."""
        port, mask = parse_pin(name)
        self.open[port] |= mask
        self.input[port] &= ~mask
        self.apply(port, self._events.now if cycle is None else cycle)

    def get(self, name: str) -> int:
        """Level of one pin in the current cycle, 0 or 1."""
        port, mask = parse_pin(name)
        return int(bool(self.levels(port, self._events.now) & mask))

    def levels(self, port: int, cycle: int) -> int:
        """Digital levels of a port in `cycle` (the present or, on waveforms, any cycle)."""
        return self._with_waveforms(port, cycle, self.level[port])

    def _with_waveforms(self, port: int, cycle: int, level: int) -> int:
        for mask, waveform in self._waveforms[port]:
            level = level & ~mask | waveform.bits(cycle) & mask
        return level

    def read_port(self, port: int, cycle: int) -> int:
        """What an instruction reads from PORT in `cycle`: outputs show one cycle late (§6)."""
        level = (self.before if cycle <= self.changed[port] else self.level)[port]
        waveform_pins = self.waveform_pins[port]
        if not waveform_pins:
            return level
        if cycle < self.constant_until[port]:
            return level & ~waveform_pins | self.constant_levels[port]
        waveforms = self._waveforms[port]
        if len(waveforms) == 1:
            ((mask, wave),) = waveforms
            waved, until = wave.bits(cycle) & mask, wave.constant_until(cycle)
        else:
            waved = self._with_waveforms(port, cycle, 0)
            until = min(wave.constant_until(cycle) for _, wave in waveforms)
        if until > cycle:
            self.constant_levels[port], self.constant_until[port] = waved, until
        return level & ~waveform_pins | waved

    def apply(self, port: int, cycle: int, by_chip: bool = False) -> None:
        """Recompute a port's levels after any of the arrays changed; they hold from `cycle` on."""
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
            self._tell_lazy(cycle, port, level, self._lazy_watchers[port])
        for mask, watcher in self._watchers[port]:
            if changed & mask:
                watcher(cycle, changed & mask, level)
