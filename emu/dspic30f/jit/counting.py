"""What native code counts or logs while it runs: cycles, executions, changes of numbers, or every instruction.

`JitEngine.start_counting` translates all code again with the counter of one of them.
"""

from __future__ import annotations

from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt

from emu.dspic30f.change_log import ChangeLog
from emu.dspic30f.core import Core
from emu.dspic30f.cycle_accounting import CycleAccounting
from emu.dspic30f.cycle_log import LONGEST_RUN
from emu.dspic30f.instruction_log import RUN_CYCLES, InstructionLog
from emu.dspic30f.jit.counters.change_counter import ChangeBoundaryCounter, ChangeCounter
from emu.dspic30f.jit.counters.cycle_counters import (
    AccountingBoundaryCounter,
    AccountingCounter,
    BoundaryCounter,
    CycleCounter,
    RowOf,
)
from emu.dspic30f.jit.counters.execution_counter import ExecutionCounter
from emu.dspic30f.jit.counters.instruction_counter import InstructionBoundaryCounter, InstructionCounter
from emu.dspic30f.jit.exit_reasons import UNFINISHED
from emu.dspic30f.jit.translate.region import Region


class Counting(Protocol):
    """A kind of counting, for `JitEngine.start_counting`."""

    address: int
    """Host address of the cells, which native code finds in the environment word ACCOUNTING."""
    longest: int | None
    """Maximum length in Tcy of a native run; None for the engine's own."""
    is_exact: bool
    """Whether only exact code is used, which can log every instruction."""

    def start(self) -> None:
        """Start to count what the sequencer runs."""

    def stop(self) -> None:
        """Stop counting."""

    def after_hooks(self) -> None:
        """Process what hooks may have changed before the instruction at PC."""

    def before_run(self) -> None:
        """Prepare for a run of native code."""

    def after_run(self, reason: int) -> None:
        """Process what native code has logged, after each of its runs. `reason` is the exit reason."""

    def counter(self) -> CycleCounter:
        """Return a counter for one translated function."""

    def boundary_counter(self) -> BoundaryCounter:
        """Return the emitter of counting code for the instruction boundaries that native code handles."""

    def identity(self, region: Region) -> Any:
        """Return all facts on which the counting code of a region depends, for the cache key of its translation."""


class CycleCounting:
    """Counts cycles by source line and CPU priority in `accounting`."""

    longest: int | None = LONGEST_RUN
    is_exact = False

    def __init__(self, accounting: CycleAccounting, row_of: RowOf) -> None:
        self._accounting: Final = accounting
        self._row_of: Final = row_of
        self.address = accounting.address
        self.start = accounting.start
        self.stop = accounting.stop

    def after_hooks(self) -> None:
        """Do nothing: hooks take no cycles."""

    def before_run(self) -> None:
        """Do nothing: the accounting has no state to prepare."""

    def after_run(self, _reason: int) -> None:
        """Account for what native code has logged."""
        self._accounting.flush_log()

    def counter(self) -> CycleCounter:
        """Return a counter for one translated function."""
        return AccountingCounter(self._accounting.words, self._accounting.tail, self._row_of)

    def boundary_counter(self) -> BoundaryCounter:
        """Return the emitter of counting code for the instruction boundaries that native code handles."""
        return AccountingBoundaryCounter(self._accounting.words, self._accounting.tail)

    def identity(self, region: Region) -> Any:
        """Return the first addresses of the source lines of the region's instructions."""
        return [self._row_of(at) for at in sorted(region.steps)]


class ExecutionCounting:
    """Counts executions and taken branches by program address, as `emu.instruments.coverage` does for the sequencer.

    Cells of executions hold differences: the count of an address is the sum of all cells up to its own.
    """

    longest: int | None = None
    is_exact = False

    def __init__(self, core: Core) -> None:
        self._words: Final = core.chip.program["flash"].end // 2
        self._memory: Final = np.zeros(2 * (self._words + 1), dtype=np.int64)
        self.address = int(self._memory.ctypes.data)

    @property
    def executions(self) -> npt.NDArray[np.int64]:
        """Return the executions by program word."""
        return np.cumsum(self._memory[: self._words])

    @property
    def taken_branches(self) -> npt.NDArray[np.int64]:
        """Return how often each branch or skip was taken, by program word."""
        return self._memory[self._words + 1 : 2 * self._words + 1]

    def start(self) -> None:
        """Do nothing: the caller counts what the sequencer runs."""

    def stop(self) -> None:
        """Do nothing."""

    def after_hooks(self) -> None:
        """Do nothing: hooks execute no instruction."""

    def before_run(self) -> None:
        """Do nothing."""

    def after_run(self, _reason: int) -> None:
        """Do nothing: native code writes no log."""

    def counter(self) -> CycleCounter:
        """Return a counter for one translated function."""
        return ExecutionCounter(self._words + 1)

    def boundary_counter(self) -> BoundaryCounter:
        """Return the counter of native boundaries, which counts nothing."""
        return BoundaryCounter()

    def identity(self, region: Region) -> Any:
        """Return the kind of counting and the layout of the cells, on which the counter's code depends."""
        return f"executions {self._words}"


class ChangeCounting:
    """Logs changes of watched numbers."""

    longest: int | None = None
    is_exact = False

    def __init__(self, core: Core, log: ChangeLog) -> None:
        self._log: Final = log
        self._ram: Final = core.chip.data["ram"].start, core.chip.data["ram"].end
        self.address = log.address
        self.start = log.start
        self.stop = log.stop
        self.before_run = log.before_run
        self.after_hooks = log.after_hooks

    def after_run(self, reason: int) -> None:
        """Log changes by a complete boundary, and deliver the log. Python still has to finish an UNFINISHED one."""
        if reason != UNFINISHED:
            self._log.after_native_run()

    def counter(self) -> CycleCounter:
        """Return a counter for one translated function."""
        return ChangeCounter(self._log, self._ram)

    def boundary_counter(self) -> BoundaryCounter:
        """Return the emitter of counting code for the instruction boundaries that native code handles."""
        return ChangeBoundaryCounter()

    def identity(self, region: Region) -> Any:
        """Return what is watched."""
        return "changes", self._log.watched, self._log.leaves, self._log.every_write


class InstructionLogging:
    """Logs every instruction. Boundaries are left to the sequencer, which logs them."""

    longest: int | None = RUN_CYCLES
    is_exact = True

    def __init__(self, log: InstructionLog) -> None:
        self.address = log.address
        self.start = log.start
        self.stop = log.stop
        self.before_run = log.before_run
        self._deliver = log.after_run

    def after_hooks(self) -> None:
        """Do nothing: the log holds the state before each instruction."""

    def after_run(self, _reason: int) -> None:
        """Deliver the log."""
        self._deliver()

    def counter(self) -> CycleCounter:
        """Return a counter for one translated function."""
        return InstructionCounter()

    def boundary_counter(self) -> BoundaryCounter:
        """Return the counter that leaves all boundaries to the sequencer."""
        return InstructionBoundaryCounter()

    def identity(self, region: Region) -> Any:
        """Return the kind of counting, on which alone the counter's code depends."""
        return "instructions"
