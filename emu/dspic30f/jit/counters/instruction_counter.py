"""Log of instructions in native code (emu/dspic30f/instruction_log.py): one entry before each instruction.

It needs exact code, which keeps the whole state in the record. Native code leaves every boundary to the sequencer.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from emu.dspic30f.instruction_log import CORE_BYTES, COUNT, ENTRY_BYTES, FIRST_ENTRY
from emu.dspic30f.jit.counters.cycle_counters import BoundaryCounter, CycleCounter
from emu.dspic30f.jit.environment import ACCOUNTING
from emu.dspic30f.jit.ir.values import Emitter

_LOG: Final = """declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)
define internal void @log(ptr noalias %rec, ptr noalias %log, i64 %pc) noinline {{
  %count.place = getelementptr i64, ptr %log, i64 {count}
  %count = load i64, ptr %count.place
  %count.next = add i64 %count, 1
  store i64 %count.next, ptr %count.place
  %offset = mul i64 %count, {entry}
  %entries = getelementptr i8, ptr %log, i64 {first}
  %place = getelementptr i8, ptr %entries, i64 %offset
  %cycle.place = getelementptr i8, ptr %rec, i64 {cycle}
  %cycle = load i64, ptr %cycle.place
  store i64 %cycle, ptr %place
  %pc.place = getelementptr i64, ptr %place, i64 1
  store i64 %pc, ptr %pc.place
  %core.place = getelementptr i64, ptr %place, i64 2
  call void @llvm.memcpy.p0.p0.i64(ptr %core.place, ptr %rec, i64 {core}, i1 false)
  ret void
}}
"""


class InstructionCounter(CycleCounter):
    """Counter of one translated function that logs every instruction."""

    def begin(self, emitter: Emitter, offset: Mapping[str, int]) -> None:
        """Prepare for the function that `emitter` writes."""
        self._e, self._cycle = emitter, offset["cpu.cycle"]

    def prologue(self, head: Emitter) -> None:
        """Emit the address of the log."""
        head.line(f"%x.logword = getelementptr i64, ptr %env, i64 {ACCOUNTING}")
        head.line("%x.log = load ptr, ptr %x.logword")

    def begin_instruction(self, pc: int) -> None:
        """Emit an entry with cycle, PC and core registers."""
        self._e.line(f"call void @log(ptr %rec, ptr %x.log, i64 {pc})")

    def definitions(self) -> str:
        """Return the IR of the function that writes an entry."""
        return _LOG.format(count=COUNT, entry=ENTRY_BYTES, first=FIRST_ENTRY, cycle=self._cycle, core=CORE_BYTES)


class InstructionBoundaryCounter(BoundaryCounter):
    """Counter that leaves all boundaries to the sequencer."""

    is_native = False
