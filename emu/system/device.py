"""What every peripheral is made of: registers (by name, from the chip's data), interrupt lines, event slots.

A device never ticks: it computes on access, posts the cycle of its next event, and raises interrupt flags.
It knows neither the CPU nor another device; `emu.machine.machine` joins them by handing over registers,
lines and signals.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from emu.system.bus import Bus, ReadHook, WriteHook
from emu.system.events import Events
from emu.system.record import Record
from emu.system.rules import Cell, InterruptLine, Rule, cell_of


class Register:
    """One SFR as its device sees it: the word lives in the record at the register's own address."""

    __slots__ = ("_fields", "_u16", "_word", "address", "bus", "name")

    def __init__(self, bus: Bus, name: str, address: int, fields: Mapping[str, tuple[int, int]]) -> None:
        self.bus: Final = bus
        self.name: Final = name
        self.address: Final = address
        self._word: Final = address >> 1
        self._u16: Final = bus.record.u16
        self._fields: Final = {key: (lsb, (1 << width) - 1) for key, (lsb, width) in fields.items()}
        bus.modelled[self._word] = True

    @property
    def value(self) -> int:
        """The stored word, 0..0xFFFF."""
        return self._u16[self._word]

    @value.setter
    def value(self, word: int) -> None:
        self._u16[self._word] = word & 0xFFFF

    def __getitem__(self, field: str) -> int:
        """The named field, right-aligned. Raises KeyError for a field the register does not have."""
        lsb, ones = self._fields[field]
        return self._u16[self._word] >> lsb & ones

    def __setitem__(self, field: str, number: int) -> None:
        lsb, ones = self._fields[field]
        self._u16[self._word] = self._u16[self._word] & ~(ones << lsb) & 0xFFFF | (number & ones) << lsb

    def set_rule(self, rule: Rule) -> None:
        """Accesses follow `rule` where it can say what they do."""
        self.bus.rules[self._word] = rule

    @property
    def place(self) -> Cell:
        """Where the word is, for rules."""
        return Cell(self.address, 16)

    def computed(self, hook: ReadHook) -> None:
        """Reads return `hook()`, a function of the cycle and of device state without side effects."""
        self.bus.compute[self._word] = hook

    def read_by(self, hook: ReadHook) -> None:
        """Reads by instructions return `hook()`, which may change device state."""
        self.bus.on_read[self._word] = hook

    def written_by(self, hook: WriteHook) -> None:
        """After a write by an instruction `hook(old, new, lanes)` is called."""
        self.bus.on_write[self._word] = hook


FLAG_WORDS: Final = 4
"""The flag registers of a chip are consecutive and at most this many."""


def flag_row(flag_address: int) -> int:
    """Place of an interrupt flag register's bit 0 in `irq.since`."""
    return (flag_address >> 1) % FLAG_WORDS * 16


def flag_since(record: Record, flag_address: int, flag_bit: int) -> int:
    """Index in `record.u64` of the cycle in which an interrupt flag was first 1: c of isa.md §14.3."""
    table = record.fields.get("irq.since") or record.reserve("irq.since", "Q", 16 * FLAG_WORDS)
    return table.index + flag_row(flag_address) + flag_bit


class Irq:
    """One interrupt request line: setting it sets the IFS bit and makes the engine look."""

    __slots__ = ("_bit", "_events", "_since", "_u16", "_u64", "_word", "line")

    def __init__(self, record: Record, events: Events, flag_address: int, flag_bit: int) -> None:
        self._u16: Final = record.u16
        self._u64: Final = record.u64
        self._events: Final = events
        self._word: Final = flag_address >> 1
        self._bit: Final = 1 << flag_bit
        self._since: Final = flag_since(record, flag_address, flag_bit)
        self.line: Final = InterruptLine(
            Cell(flag_address, 16), self._bit, Cell(8 * self._since, 64), cell_of(record, "events.deadline")
        )
        """For rules."""

    def request(self) -> None:
        """Set the interrupt flag: it first reads 1 in the cycle of the event that calls this.

        Called from an access hook instead, it counts as raised one cycle after that access (engines.md §4.2).
        """
        if not self._u16[self._word] & self._bit:
            self._u16[self._word] |= self._bit
            self._u64[self._since] = self._events.now + (not self._events.firing)
        self._events.kick()

    @property
    def pending(self) -> bool:
        """Whether the flag is set."""
        return bool(self._u16[self._word] & self._bit)


class Device:
    """Base of all peripherals: remembers the record, the clock and its own name; resets are explicit."""

    def __init__(self, name: str, bus: Bus) -> None:
        self.name: Final = name
        self.bus: Final = bus
        self.record: Final = bus.record
        self.events: Final = bus.events

    @property
    def now(self) -> int:
        """Cycle of the access or event being handled, in Tcy."""
        return self.events.now

    def reset(self, power_on: bool) -> None:
        """Bring hidden state to its reset value. SFRs have been reset already; event slots are idle."""
