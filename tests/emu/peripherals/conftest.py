"""Test rig for devices without a CPU: register accesses at chosen cycles on a real bus and clock."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.peripherals import CpuSignals, Peripherals, build
from emu.system.bus import Bus
from emu.system.events import Events
from emu.system.program import ProgramMemory
from emu.system.record import Record

XT_PLL8 = 0xFFE6
"""Configuration word FOSC of the e-puck (§2): Fcy = 14.7456 MHz."""


class Rig:
    """Devices on a bus, without a CPU. Only `at` advances time; all other methods act in the current cycle."""

    chip = DSPIC30F6014A

    def __init__(self, fosc: int = XT_PLL8, fwdt: int = 0x7FFF, *more: int) -> None:
        self.record = Record(self.chip.data["ram"].end)
        self.events = Events(self.record)
        self.bus = Bus(self.record, self.events, self.chip.data["sfr"].end)
        self.program = ProgramMemory(self.record, self.chip)
        for index, word in enumerate((fosc, fwdt, *more)):
            self.program.config[index] = word
        self.cpu_signals = CpuSignals()
        self.dev: Peripherals = build(self.chip, self.bus, self.program, self.cpu_signals)
        self.dev.reset("POR")

    def at(self, cycle: int) -> Rig:
        """Advance time so that the next access is in `cycle`."""
        assert cycle >= self.events.now
        assert self.events.next_due() > self.events.now or self.events.next_due() == self.events.now == 0
        self.events.arrive(cycle)
        self.events.settle(cycle)
        return self

    def address(self, name: str) -> int:
        return self.chip.sfrs[name].address

    def read(self, name: str) -> int:
        return self.bus.read(self.address(name))

    def peek(self, name: str) -> int:
        return self.bus.peek(self.address(name))

    def write(self, name: str, value: int, lanes: int = 0xFFFF) -> None:
        self.bus.write(self.address(name), value, lanes)

    def write_all(self, **values: int) -> None:
        """Write registers in this order, all in the current cycle."""
        for name, value in values.items():
            self.write(name, value)

    def field(self, register: str, name: str) -> int:
        lsb, width = self.chip.sfrs[register].fields[name]
        return self.peek(register) >> lsb & (1 << width) - 1

    def flag(self, source: str) -> int:
        """Return the interrupt flag with this name, for example "T1IF"."""
        return next(
            self.field(word, source) for word in ("IFS0", "IFS1", "IFS2") if source in self.chip.sfrs[word].fields
        )

    def clear_flags(self) -> None:
        for word in ("IFS0", "IFS1", "IFS2"):
            self.write(word, 0)

    def first_cycle(self, condition: Callable[[], object], start: int, end: int) -> int:
        """Return the first cycle in start..end in which `condition()` holds."""
        for cycle in range(start, end + 1):
            self.at(cycle)
            if condition():
                return cycle
        raise AssertionError(f"never true in cycles {start}..{end}")


@pytest.fixture
def rig() -> Rig:
    return Rig()
