"""Log of instructions: the state before each instruction and before each boundary.

Input: a connected core. Output: entries for a consumer, in order. For what the sequencer runs, this module wraps the
sequencer. Native code appends to the same memory (jit/counters/instruction_counter.py). Replayed cycles and diagnosis
are not logged.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from emu.dspic30f.core import ONE_INSTRUMENT, Core

CORE_END: Final = 0x0054
"""First data address after the core's registers (isa.md §2.1)."""
CORE_BYTES: Final = (CORE_END + 7) // 8 * 8
COUNT: Final = 0
"""Word of the log with the number of entries."""
FIRST_ENTRY: Final = 64
"""Byte offset of the first entry."""
BOUNDARY: Final = 1 << 32
"""Bit in an entry's second word: the entry describes the state before a boundary, not before an instruction."""
ENTRY: Final = np.dtype([("cycle", "<u8"), ("pc", "<u8"), ("core", "<u2", (CORE_BYTES // 2,))])
ENTRY_BYTES: Final = ENTRY.itemsize
RUN_CYCLES: Final = 8192
"""Maximum length in Tcy of a native run, which logs at most one entry per cycle."""
ROOM: Final = 4 * RUN_CYCLES
"""Capacity of the log in entries."""
_RESERVE: Final = RUN_CYCLES + 64
"""Free entries that a native run needs, including those of instructions that it then leaves to the sequencer."""

Entries = npt.NDArray[np.void]


class InstructionLog:
    """Logs instructions and boundaries between `start` and `stop` to `consumer`, which receives arrays of entries.

    An entry with the cycle and the PC of the one after it describes nothing that happened: native code has left the
    instruction to the sequencer, or the boundary had no work.
    """

    def __init__(self, core: Core, consumer: Callable[[Entries], object]) -> None:
        self._core: Final = core
        self._consumer: Final = consumer
        memory = np.zeros(FIRST_ENTRY + ENTRY_BYTES * ROOM, dtype=np.uint8)
        self._memory: Final = memory
        self._count: Final = memory[:8].view(np.uint64)
        self._entries: Final[Entries] = memory[FIRST_ENTRY:].view(ENTRY)
        self._cycles, self._pcs, self._cores = (self._entries[name] for name in ("cycle", "pc", "core"))
        self._registers: Final = np.frombuffer(core.record.bytes, dtype=np.uint16, count=CORE_BYTES // 2)
        self.address: Final = int(memory.ctypes.data)
        """Host address of the log."""
        self._undo: Final[list[Callable[[], None]]] = []

    def start(self) -> None:
        """Start to log the instructions and boundaries that the sequencer executes."""
        sequencer = self._core.sequencer
        if "execute" in vars(sequencer):
            raise ValueError(ONE_INSTRUMENT)
        for name, mark in (("execute", 0), ("boundary", BOUNDARY)):
            vars(sequencer)[name] = self._logged(getattr(sequencer, name), mark)
            self._undo.append(partial(delattr, sequencer, name))

    def stop(self) -> None:
        """Restore the sequencer and deliver the remaining entries."""
        while self._undo:
            self._undo.pop()()
        self.flush()

    def before_run(self) -> None:
        """Make room for the entries of a run of native code."""
        if self._core.events.quiet or self._count[0] > ROOM - _RESERVE:
            self.flush()

    def after_run(self) -> None:
        """Drop the entries of replayed cycles."""
        if self._core.events.quiet:
            self._count[0] = 0

    def flush(self) -> None:
        """Pass the entries to the consumer and empty the log."""
        count = int(self._count[0])
        self._count[0] = 0
        if count:
            self._consumer(self._entries[:count])

    def present(self) -> Entries:
        """Return an entry for the present state."""
        entry = np.zeros(1, dtype=ENTRY)
        entry["cycle"], entry["pc"], entry["core"] = self._core.state.cycle, self._core.state.pc, self._registers
        return entry

    def _logged(self, work: Callable[..., Any], mark: int) -> Callable[..., Any]:
        state, events, cycles, pcs, cores = self._core.state, self._core.events, self._cycles, self._pcs, self._cores
        count, registers = self._count, self._registers

        def logged(*arguments: Any) -> Any:
            if not events.quiet:
                number = int(count[0])
                if number == ROOM:
                    self.flush()
                    number = 0
                cycles[number], pcs[number], cores[number] = state.cycle, state.pc | mark, registers
                count[0] = number + 1
            return work(*arguments)

        return logged
