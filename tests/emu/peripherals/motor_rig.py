"""Test rig for the devices of the dsPIC30F4011 without a CPU. Times are cycles from power-on."""

from __future__ import annotations

from collections.abc import Iterator

from emu.chips.dspic30f4011 import DSPIC30F4011
from emu.peripherals import CpuSignals, Peripherals, build
from emu.system.bus import Bus
from emu.system.events import Events
from emu.system.program import ProgramMemory
from emu.system.record import Record


class MotorRig:
    """Devices on a bus. Only `at` advances time; all other methods act in the current cycle."""

    def __init__(self, fborpor: int = 0xFFFF) -> None:
        self.record = Record(DSPIC30F4011.data["ram"].end)
        self.events = Events(self.record)
        self.bus = Bus(self.record, self.events, DSPIC30F4011.data["sfr"].end)
        program = ProgramMemory(self.record, DSPIC30F4011)
        for index, word in enumerate((0xFFF6, 0x7FFF, fborpor)):
            program.config[index] = word
        self.dev: Peripherals = build(DSPIC30F4011, self.bus, program, CpuSignals())
        self.dev.reset("POR")
        self.dev.pins.set("RE8", 1)

    def at(self, cycle: int) -> MotorRig:
        """Advance time so that the next access is in `cycle`."""
        assert cycle >= self.events.now
        self.events.arrive(cycle)
        self.events.settle(cycle)
        return self

    def read(self, name: str) -> int:
        return self.bus.read(DSPIC30F4011.sfrs[name].address)

    def write(self, name: str, value: int) -> None:
        self.bus.write(DSPIC30F4011.sfrs[name].address, value, 0xFFFF)

    def flag(self, source: str) -> int:
        """Return an interrupt flag, for example "PWM"."""
        one = next(one for one in DSPIC30F4011.interrupts.values() if one.name == source)
        return self.record.u16[DSPIC30F4011.sfrs[one.flag[0]].address >> 1] >> one.flag[1] & 1

    def clear_flags(self) -> None:
        for name in ("IFS0", "IFS1", "IFS2"):
            self.write(name, 0)

    def levels(self, pin: str, first: int, last: int) -> Iterator[int]:
        """Yield the level of a pin in each cycle first <= c <= last."""
        for cycle in range(first, last + 1):
            yield self.at(cycle).dev.pins.get(pin)

    def edges(self, pins: str, first: int, last: int) -> list[tuple[int, str, int]]:
        """Return (cycle, pin, level) of the changes in first < c <= last."""
        names = pins.split()
        before = {pin: self.at(first).dev.pins.get(pin) for pin in names}
        found = []
        for cycle in range(first + 1, last + 1):
            self.at(cycle)
            for pin in names:
                level = self.dev.pins.get(pin)
                if level != before[pin]:
                    found.append((cycle, pin, level))
                    before[pin] = level
        return found
