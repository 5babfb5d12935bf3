"""Test rig for the devices of the dsPIC30F4011 without a CPU. Times are cycles from power-on."""

from __future__ import annotations

from collections.abc import Iterator

from emu.chips.dspic30f4011 import DSPIC30F4011

from ..conftest import Rig


class MotorRig(Rig):
    """Devices on a bus. Only `at` advances time; all other methods act in the current cycle."""

    chip = DSPIC30F4011

    def __init__(self, fborpor: int = 0xFFFF) -> None:
        super().__init__(0xFFF6, 0x7FFF, fborpor)
        self.dev.pins.set("RE8", 1)

    def flag(self, source: str) -> int:
        """Return an interrupt flag, for example "PWM"."""
        one = next(one for one in DSPIC30F4011.interrupts.values() if one.name == source)
        return self.record.u16[DSPIC30F4011.sfrs[one.flag[0]].address >> 1] >> one.flag[1] & 1

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
