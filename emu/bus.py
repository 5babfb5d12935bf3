"""Data space as devices see it: which SFR bits exist, and who is told when one is read or written.

What enters: masks and reset values of a chip (data), hooks of devices. What leaves: `read`/`write` of SFR words for
the engines, `peek`/`poke` for tools. Plain memory is not handled here: engines go to the record directly.
The CPU's own registers are hooked by the CPU like any device's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.events import Events
from emu.record import Record

SFR_END: Final = 0x0800
"""First data address behind the SFRs (isa.md §1.2)."""

ReadHook = Callable[[], int]
WriteHook = Callable[[int, int, int], None]
"""Called as hook(old, new, lanes) after the new word is in the record; lanes = 0xFFFF, 0x00FF or 0xFF00."""


class Bus:
    """SFR space 0x0000-0x07FF. Word index = address >> 1. Unimplemented bits read 0 and ignore writes."""

    def __init__(self, record: Record, events: Events) -> None:
        self.record: Final = record
        self.events: Final = events
        words = SFR_END // 2
        self.writable: Final = [0] * words
        """Bits software can change freely."""
        self.clear_only: Final = [0] * words
        """Bits software can clear but not set."""
        self.reset_value: Final = [0] * words
        self.name: Final = [""] * words
        self.compute: Final[list[ReadHook | None]] = [None] * words
        """Registers that are a function of the cycle and device state; no side effects."""
        self.on_read: Final[list[ReadHook | None]] = [None] * words
        """Registers whose read changes something; returns the word read."""
        self.on_write: Final[list[WriteHook | None]] = [None] * words
        self.modelled: Final = [False] * words
        """Set for registers a device or the CPU stands behind; others are reported once when touched."""
        self.off: Final[set[int]] = set()
        """Registers of modules that are switched off: they read 0 and ignore writes."""
        self.watched: Final[set[int]] = set()
        """Registers every access of which somebody outside wants to see."""
        self.report: Callable[[int, bool], None] | None = None
        """Called as report(address, is_write) at the first touch of a register nobody models."""
        self._reported: set[int] = set()

    def read(self, address: int) -> int:
        """The word at even SFR `address` (0..0x7FE) as an instruction reads it, side effects included."""
        word = address >> 1
        hook = self.on_read[word] or self.compute[word]
        if hook is not None:
            return hook()
        if not self.modelled[word] and word not in self._reported:
            self._first_touch(word, False)
        return self.record.u16[word]

    def write(self, address: int, value: int, lanes: int = 0xFFFF) -> None:
        """Store `value` at even SFR `address`; only bits in `lanes` (byte writes) are touched."""
        word = address >> 1
        u16 = self.record.u16
        old = u16[word]
        free = self.writable[word] & lanes
        new = (old & ~free) | (value & free)
        clearing = self.clear_only[word] & lanes
        if clearing:
            new &= value | ~clearing
        u16[word] = new
        hook = self.on_write[word]
        if hook is not None:
            hook(old, new, lanes)
        elif not self.modelled[word] and word not in self._reported:
            self._first_touch(word, True)

    def peek(self, address: int) -> int:
        """The word at even SFR `address`, without side effects."""
        hook = self.compute[address >> 1]
        return hook() if hook is not None else self.record.u16[address >> 1]

    def poke(self, address: int, value: int) -> None:
        """Set the stored word at even SFR `address`, telling nobody."""
        self.record.u16[address >> 1] = value & 0xFFFF

    def _first_touch(self, word: int, is_write: bool) -> None:
        self._reported.add(word)
        if self.report is not None:
            self.report(word << 1, is_write)
