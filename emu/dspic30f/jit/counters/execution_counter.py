"""Execution counts in native code: one addition at each end of a run of consecutive instructions.

Cells hold differences, so that a block of any length costs two additions: one at its first word, and a subtraction at
the word after it. An instruction of two words ends a run, because its second word is not counted. An exit from the
middle of a block first adds the instructions up to that point.
"""

from __future__ import annotations

from typing import Final

from emu.dspic30f.jit.counters.cycle_counters import CycleCounter
from emu.dspic30f.jit.environment import ACCOUNTING
from emu.dspic30f.jit.ir.values import Emitter, Number, Value


class ExecutionCounter(CycleCounter):
    """Counter of executions, and of taken branches in the cells from index `taken` on."""

    def __init__(self, taken: int) -> None:
        self._first_taken: Final = taken
        self._executed: Final[list[tuple[int, int, Number]]] = []
        """Runs of instructions: address of the first, address after the first word of the last, executions."""
        self._taken: Final[list[tuple[int, Number]]] = []

    def begin(self, emitter: Emitter, offset: object) -> None:
        """Prepare for the function that `emitter` writes."""
        self._e = emitter

    @property
    def unsettled(self) -> tuple[object, ...]:  # type: ignore[override]
        """Return the counts that an exit would add."""
        counts = [*self._executed, *self._taken]
        return tuple((*one[:-1], one[-1].text if isinstance(one[-1], Value) else one[-1]) for one in counts)

    def prologue(self, head: Emitter) -> None:
        """Emit the address of the cells, which every block of the function uses."""
        head.line(f"%x.countword = getelementptr i64, ptr %env, i64 {ACCOUNTING}")
        head.line("%x.counts = load ptr, ptr %x.countword")

    def count_execution(self, pc: int, times: Number = 1) -> None:
        """Count executions of the instruction at `pc`; extend the last run if this continues it."""
        if self._executed and isinstance(times, int) and times == 1:
            first, end, before = self._executed[-1]
            if end == pc and isinstance(before, int) and before == 1:
                self._executed[-1] = (first, pc + 2, 1)
                return
        self._executed.append((pc, pc + 2, times))

    def count_taken(self, pc: int, times: Number = 1) -> None:
        """Count that the branch or skip at `pc` is taken."""
        self._taken.append((pc, times))

    def flush(self) -> None:
        """Emit the additions and clear the counts."""
        self.flush_at_exit()
        self._executed.clear()
        self._taken.clear()

    def flush_at_exit(self) -> None:
        """Emit the additions; keep the counts for the rest of the block."""
        for first, end, times in self._executed:
            self._add(first >> 1, times)
            self._add(end >> 1, -times if isinstance(times, int) else 0 - times)
        for pc, times in self._taken:
            self._add(self._first_taken + (pc >> 1), times)

    def _add(self, index: int, number: Number) -> None:
        cell = self._e.name()
        self._e.line(f"{cell} = getelementptr i64, ptr %x.counts, i64 {index}")
        self._e.store(cell, self._e.load(cell, 64) + number, 64)
