"""Trap requests: INTCON1 flags, the cycle of each request, and trap conflicts (isa.md §14.4).

A request persists: its flag stays set until software clears it. Traps are accepted by the same rule as interrupts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from emu.chips.chip import Chip, Vector
from emu.dspic30f.exceptions.faults import TrapConflict
from emu.dspic30f.state.state import OA, OB, State
from emu.system.events import Events

HARD_LEVEL: Final = 13
"""Lowest priority of hard traps. No instruction runs between the faulting instruction and a hard trap's handler."""


@dataclass(frozen=True, slots=True)
class Trap:
    """One trap: its INTCON1 flag, its vector, and the index of the cell with its request cycle."""

    flag: int
    vector: Vector
    since: int


class Traps:
    """The four traps of the core. `all` lists them by falling priority."""

    def __init__(self, state: State, events: Events, chip: Chip) -> None:
        self._state: Final = state
        self._events: Final = events
        self._u64: Final = state.record.u64
        fields = chip.sfrs["INTCON1"].fields
        since = state.record.reserve("cpu.trap_since", "Q", 4).index
        by_name = {vector.name: vector for vector in chip.vectors}

        def trap(number: int, flag: str, vector: str) -> Trap:
            return Trap(1 << fields[flag][0], by_name[vector], since + number)

        self.oscillator: Final = trap(0, "OSCFAIL", "OscillatorFail")
        self.address: Final = trap(1, "ADDRERR", "AddressError")
        self.stack: Final = trap(2, "STKERR", "StackError")
        self.math: Final = trap(3, "MATHERR", "MathError")
        self.all: Final = (self.oscillator, self.address, self.stack, self.math)
        self._by_flag: Final = {"OSCFAIL": self.oscillator, "ADDRERR": self.address, "STKERR": self.stack}
        self.flags: Final = sum(trap.flag for trap in self.all)
        self._overflow: Final = tuple(
            (1 << fields[enable][0], overflow) for enable, overflow in (("OVATE", OA), ("OVBTE", OB))
        )

    def request(self, trap: Trap, cycle: int) -> None:
        """Set a trap's flag, which is visible from `cycle` on. Raises TrapConflict."""
        state = self._state
        if trap.vector.level >= HARD_LEVEL and state.ipl > trap.vector.level:
            raise TrapConflict(f"{trap.vector.name} below a higher trap")
        for higher in self.all:
            if higher.vector.level > trap.vector.level >= HARD_LEVEL and state.intcon1 & higher.flag:
                raise TrapConflict(f"{trap.vector.name} below a higher trap")
        if not state.intcon1 & trap.flag:
            state.intcon1 |= trap.flag
            self._u64[trap.since] = cycle
        self._events.kick()

    def request_flag(self, flag: str) -> None:
        """Request the trap whose INTCON1 flag is called `flag`; for devices. It becomes visible as in `Irq.request`.

        Raises TrapConflict, KeyError for an unknown flag.
        """
        self.request(self._by_flag[flag], self._events.now + (not self._events.firing))

    def intcon1_written(self, old: int, new: int) -> None:
        """Handle a write of INTCON1.

        A flag set by the write is a request. An accumulator overflow that persists requests its trap again.
        """
        for enable, overflow in self._overflow:
            if new & enable and self._state.sr & overflow:
                new |= self.math.flag
        self._state.intcon1 = new
        for trap in self.all:
            if new & trap.flag and (not old & trap.flag or trap is self.math):
                self._u64[trap.since] = self._events.now + 1
        self._events.kick()
