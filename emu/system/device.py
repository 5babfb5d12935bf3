"""Base class of devices, and their parts: registers, interrupt lines and event slots.

A device has no periodic tick. It computes its state on access, posts the cycle of its next event, and sets interrupt
flags. It knows neither the CPU nor other devices; `emu.machine.machine` connects them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from emu.system.bus import Bus, ReadHook, WriteHook
from emu.system.events import Events
from emu.system.record import Record
from emu.system.rules import Cell, InterruptLine, Rule, cell_of


class Register:
    """One SFR of a device. Its word is in the record at the register's address."""

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
        """Return the stored word, 0..0xFFFF."""
        return self._u16[self._word]

    @value.setter
    def value(self, word: int) -> None:
        self._u16[self._word] = word & 0xFFFF

    def __getitem__(self, field: str) -> int:
        """Return the named field, right-aligned. Raises KeyError for an unknown field."""
        lsb, ones = self._fields[field]
        return self._u16[self._word] >> lsb & ones

    def __setitem__(self, field: str, number: int) -> None:
        lsb, ones = self._fields[field]
        self._u16[self._word] = self._u16[self._word] & ~(ones << lsb) & 0xFFFF | (number & ones) << lsb

    def set_rule(self, rule: Rule) -> None:
        """Set the rule for the accesses that it covers."""
        self.bus.rules[self._word] = rule

    @property
    def cell(self) -> Cell:
        """Return the cell of the register's word, for rules."""
        return Cell(self.address, 16)

    def computed(self, hook: ReadHook) -> None:
        """Make reads return `hook()`, a function of the cycle and of device state without side effects."""
        self.bus.compute[self._word] = hook

    def read_by(self, hook: ReadHook) -> None:
        """Make reads by instructions return `hook()`, which may change device state."""
        self.bus.on_read[self._word] = hook

    def written_by(self, hook: WriteHook) -> None:
        """Call `hook(old, new, lanes)` after each write by an instruction."""
        self.bus.on_write[self._word] = hook


FLAG_WORDS: Final = 4
"""Maximum number of flag registers of a chip; they are consecutive."""


def flag_row(flag_address: int) -> int:
    """Return the index in `irq.since` of bit 0 of an interrupt flag register."""
    return (flag_address >> 1) % FLAG_WORDS * 16


def flag_since(record: Record, flag_address: int, flag_bit: int) -> int:
    """Return the index in `record.u64` of the cycle in which an interrupt flag became 1: c of isa.md §14.3."""
    table = record.fields.get("irq.since") or record.reserve("irq.since", "Q", 16 * FLAG_WORDS)
    return table.index + flag_row(flag_address) + flag_bit


class Irq:
    """One interrupt request line. A request sets the IFS bit and makes the engine check for interrupts."""

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
        """Cells of the request line, for rules."""

    def request(self) -> None:
        """Set the interrupt flag. If an event calls this, the flag first reads 1 in the cycle of the event.

        If the hook of an access calls this, the flag first reads 1 one cycle after the access (engines.md §4.2).
        """
        if not self._u16[self._word] & self._bit:
            self._u16[self._word] |= self._bit
            self._u64[self._since] = self._events.now + (not self._events.firing)
        self._events.kick()

    @property
    def pending(self) -> bool:
        """Return whether the flag is set."""
        return bool(self._u16[self._word] & self._bit)


class Device:
    """Base class of all peripherals. It holds the record, the event schedule and the device's name."""

    def __init__(self, name: str, bus: Bus) -> None:
        self.name: Final = name
        self.bus: Final = bus
        self.record: Final = bus.record
        self.events: Final = bus.events

    @property
    def now(self) -> int:
        """Return the cycle of the access or event that is being handled, in Tcy."""
        return self.events.now

    def reset(self, power_on: bool) -> None:
        """Set hidden state to its reset value. The SFRs have already been reset, and the event slots are idle."""
