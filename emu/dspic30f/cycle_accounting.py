"""Where every cycle goes, written down while a machine runs in any engine: by instruction and CPU priority, and who
called whom.

What enters: a wired core. What leaves: cells of cycles that add up to those that passed, and a list of calls, returns,
interrupts and sleeps for whoever follows them.
Native code keeps the ledger itself (jit/counting.py); here is the part of the sequencer, by which the plain engine is
counted whole. Nothing of it is in the way of a machine without a ledger.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from emu.dspic30f.core import Core
from emu.dspic30f.exceptions.faults import DeviceReset
from emu.dspic30f.exceptions.interrupts import Accepted
from emu.dspic30f.exceptions.power import Sleeping
from emu.dspic30f.isa.flow import Call, Return
from emu.dspic30f.state.state import STACK_POINTER

LEVELS: Final = 16
"""CPU priorities, traps included (isa.md §14.1)."""
IDLE, NOTED, CELL, NOTES = range(4)
"""Words behind the cells: cycles asleep; how many notes there are; address of the cell of the RETFIE that native code
ran last; the first note."""
NOTE_WORDS: Final = 4
"""A note: cycle; kind, level << 8, W15 << 16 (where the return address is), instruction << 32; target, cycles of an
interrupt's entry or of a sleep << 32; cycle of the request."""
CALLED, RETURNED, ENTERED, SLEPT, RESET = range(1, 6)
"""Kinds of notes."""
STRETCH: Final = 1 << 20
"""Tcy after which native code has its notes taken: there is at most one in a cycle."""
ROOM: Final = 1024
"""Notes of the sequencer that are kept."""

Taker = Callable[[int, int], None]
"""Gets the host address of the notes and their number."""


class Ledger:
    """Counts from `open` to `close`. `take` is called with notes, often enough; without it they are dropped."""

    def __init__(self, core: Core, take: Taker | None = None) -> None:
        self._core: Final = core
        self._take: Final = take
        self.words: Final = core.chip.program["flash"].end // 2
        """Cells of one level: one per program word of flash."""
        cells = LEVELS * self.words
        self._memory: Final = np.zeros(cells + NOTES + NOTE_WORDS * (STRETCH + 2 * ROOM), dtype=np.uint64)
        self.address: Final = int(self._memory.ctypes.data)
        """Of the cells, on the host; the words of IDLE and so on follow them."""
        self.tail: Final = 8 * cells
        self._tail: Final = self._memory[cells:]
        self._undo: Final[list[Callable[[], None]]] = []

    @property
    def cells(self) -> npt.NDArray[np.uint64]:
        """Cycles by CPU priority and program word, shape (16, words)."""
        return self._memory[: LEVELS * self.words].reshape(LEVELS, self.words)

    @property
    def idle(self) -> int:
        """Cycles in Idle and Sleep."""
        return int(self._tail[IDLE])

    def clear(self) -> None:
        """Nothing has been counted yet."""
        self._memory[: LEVELS * self.words] = 0
        self._tail[IDLE] = 0

    def drain(self) -> None:
        """Hand the notes over."""
        count = int(self._tail[NOTED])
        self._tail[NOTED] = 0
        if count and self._take is not None:
            self._take(self.address + self.tail + 8 * NOTES, count)

    # What the sequencer does

    def open(self) -> None:
        """Write down from now on what Python runs."""
        sequencer = self._core.sequencer
        for thing, name, made in (
            (sequencer, "execute", self._executing),
            (sequencer, "boundary", self._holding),
            (sequencer, "after_retfie", self._third_cycle),
            (sequencer.exceptions, "enter", self._entering),
            (sequencer.power, "pass_time", self._sleeping),
        ):
            vars(thing)[name] = made(getattr(thing, name))
            self._undo.append(partial(delattr, thing, name))

    def close(self) -> None:
        """Write nothing down any more."""
        while self._undo:
            self._undo.pop()()
        self.drain()

    def _spend(self, pc: int, level: int, cycles: int) -> None:
        word = min(pc >> 1, self.words - 1)
        self._memory[level * self.words + word] += np.uint64(cycles)

    def note(self, kind: int, site: int, target: int, cycles: int = 0, level: int = 0, since: int = 0) -> None:
        """Add a note of the present cycle and stack pointer."""
        state, place = self._core.state, NOTES + NOTE_WORDS * int(self._tail[NOTED])
        where = state.u16[STACK_POINTER]
        self._tail[place : place + NOTE_WORDS] = [
            state.cycle, kind | level << 8 | where << 16 | site << 32, target | cycles << 32, since,
        ]  # fmt: skip
        self._tail[NOTED] += np.uint64(1)
        if self._tail[NOTED] >= ROOM:
            self.drain()

    def _executing(self, execute: Callable[[], None]) -> Callable[[], None]:
        state, sequencer = self._core.state, self._core.sequencer
        steps: dict[int, Any] = vars(sequencer)["_steps"]

        def counted() -> None:
            pc, level, before = state.pc, state.ipl, state.cycle
            try:
                execute()
            except DeviceReset as reset:
                self._spend(pc, level, state.cycle - before + reset.fault)
                self.note(RESET, pc, 0)
                raise
            except BaseException:
                self._spend(pc, level, state.cycle - before)
                raise
            self._spend(pc, level, state.cycle - before)
            step = steps.get(pc)
            flow = step.facts.flow if step is not None else None
            if flow is Call:
                state.u16[STACK_POINTER] -= 4
                self.note(CALLED, pc, state.pc)
                state.u16[STACK_POINTER] += 4
            elif flow is Return:
                self.note(RETURNED, pc, state.pc)

        return counted

    def _holding(self, boundary: Callable[[int], bool]) -> Callable[[int], bool]:
        state, hold = self._core.state, self._core.record.fields["cpu.hold"].index

        def counted(limit: int) -> bool:
            held = self._core.record.u64[hold]
            if held > state.cycle:
                self._spend(state.pc, state.ipl, held - state.cycle)
            return boundary(limit)

        return counted

    def _third_cycle(self, after_retfie: Callable[[], None]) -> Callable[[], None]:
        state = self._core.state

        def counted() -> None:
            before = state.cycle
            after_retfie()
            third = state.cycle - before
            ctypes.c_uint64.from_address(int(self._tail[CELL])).value += third
            self._tail[NOTES + NOTE_WORDS * (int(self._tail[NOTED]) - 1)] += np.uint64(third)

        return counted

    def _entering(self, enter: Callable[[Accepted, int], None]) -> Callable[[Accepted, int], None]:
        state = self._core.state

        def counted(accepted: Accepted, last: int) -> None:
            before, pc = state.cycle, state.pc
            enter(accepted, last)
            self._spend(state.pc, state.ipl, state.cycle - before)
            state.u16[STACK_POINTER] -= 4
            self.note(ENTERED, pc, state.pc, state.cycle - before, accepted.level, accepted.since)
            state.u16[STACK_POINTER] += 4

        return counted

    def _sleeping(self, pass_time: Callable[[int], Sleeping]) -> Callable[[int], Sleeping]:
        state = self._core.state

        def counted(limit: int) -> Sleeping:
            before = state.cycle
            try:
                return pass_time(limit)
            finally:
                self._tail[IDLE] += np.uint64(state.cycle - before)
                if state.cycle > before:
                    self.note(SLEPT, state.pc, state.pc, state.cycle - before)

        return counted
