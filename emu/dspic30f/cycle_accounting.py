"""Cycle accounting: cycles by instruction address and CPU priority, and a log of calls, interrupts and sleeps.

Input: a connected core. Outputs: cells whose sum equals the cycles that passed, and log entries for a consumer.
Native code does its own accounting (jit/counters/cycle_counters.py). For the plain engine, this module wraps the
sequencer, which runs everything. A machine without accounting runs the unwrapped functions.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from emu.dspic30f.core import Core
from emu.dspic30f.cycle_log import (
    CALLED,
    ENTERED,
    ENTRY_WORDS,
    IDLE,
    LOG,
    LOG_COUNT,
    LONGEST_RUN,
    RESET,
    RETFIE_CELL,
    RETURNED,
    SLEPT,
)
from emu.dspic30f.exceptions.faults import DeviceReset
from emu.dspic30f.exceptions.interrupts import Accepted
from emu.dspic30f.exceptions.power import Sleeping
from emu.dspic30f.isa.flow import Call, Return
from emu.dspic30f.state.state import STACK_POINTER

LEVELS: Final = 16
"""Number of CPU priorities, including those of traps (isa.md §14.1)."""
LOG_ROOM: Final = 1024
"""Number of entries from the sequencer after which the log is flushed."""

LogConsumer = Callable[[int, int], None]
"""consumer(address, count): receives the host address and the number of log entries."""


class CycleAccounting:
    """Accounts for all cycles between `start` and `stop`. Without a consumer, log entries are discarded."""

    def __init__(self, core: Core, consumer: LogConsumer | None = None) -> None:
        self._core: Final = core
        self._consumer: Final = consumer
        self.words: Final = core.chip.program["flash"].end // 2
        """Number of cells per CPU priority: one for each program word of flash."""
        cells = LEVELS * self.words
        self._memory: Final = np.zeros(cells + LOG + ENTRY_WORDS * (LONGEST_RUN + 2 * LOG_ROOM), dtype=np.uint64)
        self.address: Final = int(self._memory.ctypes.data)
        """Host address of the cells."""
        self.tail: Final = 8 * cells
        """Byte offset of the words after the cells."""
        self._tail: Final = self._memory[cells:]
        self._undo: Final[list[Callable[[], None]]] = []

    @property
    def cells(self) -> npt.NDArray[np.uint64]:
        """Return the cycles by CPU priority and program word, shape (16, words)."""
        return self._memory[: LEVELS * self.words].reshape(LEVELS, self.words)

    @property
    def idle(self) -> int:
        """Return the cycles in Idle and Sleep."""
        return int(self._tail[IDLE])

    def clear(self) -> None:
        """Set all cells and the idle cycles to 0."""
        self._memory[: LEVELS * self.words] = 0
        self._tail[IDLE] = 0

    def flush_log(self) -> None:
        """Pass the log entries to the consumer and empty the log."""
        count = int(self._tail[LOG_COUNT])
        self._tail[LOG_COUNT] = 0
        if count and self._consumer is not None:
            self._consumer(self.address + self.tail + 8 * LOG, count)

    # The sequencer

    def start(self) -> None:
        """Start to account for all cycles that the sequencer runs."""
        sequencer = self._core.sequencer
        for owner, name, wrap in (
            (sequencer, "execute", self._count_instruction),
            (sequencer, "boundary", self._count_hold),
            (sequencer, "after_retfie", self._count_third_cycle),
            (sequencer.exceptions, "enter", self._count_entry),
            (sequencer.power, "pass_time", self._count_sleep),
        ):
            vars(owner)[name] = wrap(getattr(owner, name))
            self._undo.append(partial(delattr, owner, name))

    def stop(self) -> None:
        """Restore the sequencer and flush the log."""
        while self._undo:
            self._undo.pop()()
        self.flush_log()

    def _spend(self, pc: int, level: int, cycles: int) -> None:
        word = min(pc >> 1, self.words - 1)
        self._memory[level * self.words + word] += np.uint64(cycles)

    def _log(self, kind: int, site: int, target: int, cycles: int = 0, level: int = 0, since: int = 0) -> None:
        """Append a log entry with the current cycle and stack pointer."""
        state, entry = self._core.state, LOG + ENTRY_WORDS * int(self._tail[LOG_COUNT])
        stack = state.u16[STACK_POINTER]
        self._tail[entry : entry + ENTRY_WORDS] = [
            state.cycle, kind | level << 8 | stack << 16 | site << 32, target | cycles << 32, since,
        ]  # fmt: skip
        self._tail[LOG_COUNT] += np.uint64(1)
        if self._tail[LOG_COUNT] >= LOG_ROOM:
            self.flush_log()

    def _count_instruction(self, execute: Callable[[], None]) -> Callable[[], None]:
        state, sequencer = self._core.state, self._core.sequencer
        steps: dict[int, Any] = vars(sequencer)["_steps"]

        def counted() -> None:
            pc, level, before = state.pc, state.ipl, state.cycle
            try:
                execute()
            except DeviceReset as reset:
                self._spend(pc, level, state.cycle - before + reset.fault)
                self._log(RESET, pc, 0)
                raise
            except BaseException:
                self._spend(pc, level, state.cycle - before)
                raise
            self._spend(pc, level, state.cycle - before)
            step = steps.get(pc)
            flow = step.facts.flow if step is not None else None
            if flow is Call:
                state.u16[STACK_POINTER] -= 4
                self._log(CALLED, pc, state.pc)
                state.u16[STACK_POINTER] += 4
            elif flow is Return:
                self._log(RETURNED, pc, state.pc)

        return counted

    def _count_hold(self, boundary: Callable[[int], bool]) -> Callable[[int], bool]:
        state, hold = self._core.state, self._core.record.fields["cpu.hold"].index

        def counted(limit: int) -> bool:
            held = self._core.record.u64[hold]
            if held > state.cycle:
                self._spend(state.pc, state.ipl, held - state.cycle)
            return boundary(limit)

        return counted

    def _count_third_cycle(self, after_retfie: Callable[[], None]) -> Callable[[], None]:
        state = self._core.state

        def counted() -> None:
            before = state.cycle
            after_retfie()
            third = state.cycle - before
            ctypes.c_uint64.from_address(int(self._tail[RETFIE_CELL])).value += third
            self._tail[LOG + ENTRY_WORDS * (int(self._tail[LOG_COUNT]) - 1)] += np.uint64(third)

        return counted

    def _count_entry(self, enter: Callable[[Accepted, int], None]) -> Callable[[Accepted, int], None]:
        state = self._core.state

        def counted(accepted: Accepted, last: int) -> None:
            before, pc = state.cycle, state.pc
            enter(accepted, last)
            self._spend(state.pc, state.ipl, state.cycle - before)
            state.u16[STACK_POINTER] -= 4
            self._log(ENTERED, pc, state.pc, state.cycle - before, accepted.level, accepted.since)
            state.u16[STACK_POINTER] += 4

        return counted

    def _count_sleep(self, pass_time: Callable[[int], Sleeping]) -> Callable[[int], Sleeping]:
        state = self._core.state

        def counted(limit: int) -> Sleeping:
            before = state.cycle
            try:
                return pass_time(limit)
            finally:
                self._tail[IDLE] += np.uint64(state.cycle - before)
                if state.cycle > before:
                    self._log(SLEPT, state.pc, state.pc, state.cycle - before)

        return counted
