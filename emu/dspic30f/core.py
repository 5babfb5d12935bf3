"""The CPU of one machine: connects all parts of `emu.dspic30f` with the record, the event schedule and the bus."""

from __future__ import annotations

from typing import Final

from emu.chips.chip import Chip
from emu.dspic30f.exceptions.interrupts import Exceptions
from emu.dspic30f.exceptions.traps import Traps
from emu.dspic30f.interpreter.plain import Interpreter
from emu.dspic30f.interpreter.sequencer import Sequencer
from emu.dspic30f.state.data_space import DataSpace
from emu.dspic30f.state.registers import CoreRegisters
from emu.dspic30f.state.state import State
from emu.system.bus import Bus
from emu.system.events import Events
from emu.system.program import ProgramMemory
from emu.system.record import Record

ONE_INSTRUMENT: Final = "one instrument at a time: a profile, coverage, watched numbers or a trace"
"""Message of an error: two instruments of a core would count or log in the same native code."""


class WRegisters:
    """W0..W15 for tools and tests. Writing an element counts as a word write by the program."""

    def __init__(self, state: State) -> None:
        self._state: Final = state

    def __len__(self) -> int:
        return 16

    def __getitem__(self, number: int) -> int:
        if not 0 <= number < 16:
            raise IndexError(f"there is no W{number}")
        return self._state.u16[number]

    def __setitem__(self, number: int, value: int) -> None:
        if not 0 <= number < 16:
            raise IndexError(f"there is no W{number}")
        self._state.set_w(number, value)


class Core:
    """One CPU: its state, sequencer, exceptions and power saving."""

    def __init__(self, record: Record, events: Events, bus: Bus, program: ProgramMemory, chip: Chip) -> None:
        self.record: Final = record
        self.events: Final = events
        self.bus: Final = bus
        self.program: Final = program
        self.chip: Final = chip
        self.state: Final = State(record, chip)
        self.w: Final = WRegisters(self.state)
        self.data: Final = DataSpace(self.state, bus, program, chip)
        self.registers: Final = CoreRegisters(self.state, bus, events)
        self.traps: Final = Traps(self.state, events, chip)
        self.exceptions: Final = Exceptions(self.state, events, bus, self.data, program, self.traps, chip)
        self.builder: Final = Interpreter(self.state, events, self.data, program, self.exceptions)
        self.sequencer: Final = Sequencer(self.state, events, program, self.exceptions, self.builder)

    def reset(self) -> None:
        """Reset the core, after any cause of reset. The SFRs must already have their reset values."""
        self.state.reset()
        self.exceptions.forget()
