"""Data space as seen by an instruction: W registers, SFRs, RAM and the PSV window (isa.md §1.2, §7.8).

Reads and writes never raise errors. Before an access, the caller checks for an address error with `faulty`, because a
faulting instruction writes nothing (isa.md §14.4), and advances the devices to the cycle of the access
(`Events.arrive`).
"""

from __future__ import annotations

from typing import Final

from emu.chips.chip import Chip
from emu.dspic30f.state.state import PSV, State
from emu.system.bus import Bus
from emu.system.program import ProgramMemory

W_END: Final = 0x20
"""First data address after the memory-mapped W registers (isa.md §1.2)."""
WINDOW: Final = 0x8000
"""First address of the PSV window (isa.md §7.8)."""


class DataSpace:
    """Data space of one CPU: 64 KB of addresses."""

    def __init__(self, state: State, bus: Bus, program: ProgramMemory, chip: Chip) -> None:
        self._state: Final = state
        self._bus: Final = bus
        self._program: Final = program
        self._u8: Final = state.u8
        self._u16: Final = state.u16
        self._corcon: Final = state.at["CORCON"]
        self._psvpag: Final = state.at["PSVPAG"]
        self.sfr_end: Final = bus.end
        self._ram_end: Final = chip.data["ram"].end
        self._y: Final = chip.data["yram"]

    def in_window(self, ea: int) -> bool:
        """Return whether a read at `ea` accesses program memory."""
        return ea >= WINDOW and bool(self._u16[self._corcon] & PSV)

    def faulty(self, ea: int, size: int) -> bool:
        """Return whether an access of `size` bytes at `ea` is an address error: misaligned or unimplemented (§14.4)."""
        if size == 2 and ea & 1:
            return True
        return ea >= self._ram_end and not self.in_window(ea)

    def read(self, ea: int, size: int) -> int:
        """Return the byte or aligned word at `ea`; 0 for an unimplemented address."""
        if ea < self.sfr_end:
            word = self._u16[ea >> 1] if ea < W_END else self._bus.read(ea & ~1)
        elif ea < self._ram_end:
            word = self._u16[ea >> 1]
        elif self.in_window(ea):
            word = self._program.word(self._u16[self._psvpag] << 15 | ea & 0x7FFE) & 0xFFFF
        else:
            return 0
        if size == 2:
            return word
        return word >> 8 if ea & 1 else word & 0xFF

    def read_x(self, ea: int) -> int:
        """Return a word as read by the X prefetch of MAC-class instructions: 0 from Y RAM (isa.md §1.2)."""
        return 0 if ea in self._y else self.read(ea, 2)

    def read_y(self, ea: int) -> int:
        """Return a word as read by the Y prefetch: 0 outside Y RAM (isa.md §1.2)."""
        return self._u16[ea >> 1] if ea in self._y else 0

    def write(self, ea: int, value: int, size: int) -> None:
        """Store the low byte or word of `value` at `ea`.

        A write to an address that cannot be written is lost (isa.md §7.8).
        """
        if ea < W_END:
            self._write_w(ea, value, size)
        elif ea < self.sfr_end:
            if size == 2:
                self._bus.write(ea & ~1, value & 0xFFFF)
            elif ea & 1:
                self._bus.write(ea & ~1, (value & 0xFF) << 8, 0xFF00)
            else:
                self._bus.write(ea, value & 0xFF, 0x00FF)
        elif ea < self._ram_end:
            if size == 2:
                self._u16[ea >> 1] = value & 0xFFFF
            else:
                self._u8[ea] = value & 0xFF

    def _write_w(self, ea: int, value: int, size: int) -> None:
        """Write a memory-mapped W register.

        The write can cause a stall (isa.md §13.2); a word initialises it (§2.2).
        """
        number = ea >> 1
        if size == 2:
            self._state.set_w(number, value)
        elif ea & 1:
            self._u8[ea] = value & 0xFF
        else:
            self._state.set_w_low(number, value)
        self._state.stall |= 1 << number
