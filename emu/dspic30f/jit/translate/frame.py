"""The frame of a translated function: its blocks, exits, cycles and the deadline check."""

from __future__ import annotations

from typing import Final

from emu.dspic30f.isa.builder import Context
from emu.dspic30f.jit.counters.cycle_counters import CycleCounter
from emu.dspic30f.jit.exit_reasons import CHANGED, NEXT
from emu.dspic30f.jit.ir.builder import LlvmBuilder
from emu.dspic30f.jit.ir.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.ir.variables import MemoryVariables, Variables, pointer
from emu.dspic30f.jit.machine_layout import MachineLayout
from emu.dspic30f.jit.translate.region import Region


class FunctionFrame:
    """State and helpers shared by all parts of the translator of one function.

    With `exact`, every instruction can be entered and checks the deadline before it executes, and registers stay in the
    record. Such code compiles quickly. It is used for rarely executed code and for the last instructions before an
    event.
    """

    def __init__(
        self, region: Region, layout: MachineLayout, context: Context, exact: bool, counter: CycleCounter | None = None
    ) -> None:
        self.region: Final = region
        self.layout: Final = layout
        self.exact: Final = exact
        self.e: Final = Emitter()
        self.v: Final = (MemoryVariables if exact else Variables)(self.e, layout.offset)
        self.b: Final = LlvmBuilder(self.e, self.v, layout, context)
        self.counter: Final[CycleCounter] = counter if counter is not None else CycleCounter()
        self.counter.begin(self.e, layout.offset)
        self.b.before_slow = self.counter.flush_at_exit
        self.labels: Final[dict[int, str]] = {}
        """Labels of blocks by the address of their first instruction."""
        self.unwritten: Final[list[int]] = []
        """Addresses of blocks that have a label but no code yet."""
        self._exits: Final[dict[tuple[object, ...], str]] = {}

    def label(self, pc: int) -> str:
        """Return the label of the block at `pc`; for an address outside the region, of an exit to `pc`."""
        if pc not in self.region.steps:
            return self.exit(pc, NEXT)
        if pc not in self.labels:
            self.labels[pc] = f"b{pc:x}"
            self.unwritten.append(pc)
        return self.labels[pc]

    def exit(self, pc: int, reason: int) -> str:
        """Return the label of a block that leaves the function with exit reason `reason` and PC = `pc`."""
        key = (pc, reason, *self.counter.unsettled)
        if key not in self._exits:
            label = f"out{reason}.{pc:x}" + (f".{len(self._exits)}" if len(key) > 2 else "")
            self._exits[key] = label
            current = self.e.block
            self.e.start(label)
            self.counter.flush_at_exit()
            self.v.leave(pc, reason)
            self.e.block = current
        return self._exits[key]

    def jump(self, pc: int) -> None:
        """End the block with a jump to `pc`. In exact code, leave the function if block code may exist for `pc`."""
        self.counter.flush()
        leaves = self.exact and pc in self.region.leaders
        self.e.end(f"br label %{self.exit(pc, NEXT) if leaves else self.label(pc)}")

    def fits(self, cost: Number, start: Number | None = None) -> Value:
        """Return whether `cost` cycles from cycle `start` (default: now) end before the deadline."""
        begun = self.v.get("cycle") if start is None else start
        return self.e.let(f"icmp ult i64 {wide(begun + cost)}, %stop", bit=True)

    def check_changes(self, site: int, next_pc: Number, condition: Number) -> None:
        """Where `condition` holds, let the counter compare the state after the instruction at `site`.

        It may make native code return before the instruction at `next_pc`.
        """
        if isinstance(condition, int) and not condition:
            return
        e, cycle = self.e, self.v.get("cycle")
        check, leave, on = (e.fresh(name) for name in ("check", "leave", "on"))
        e.end(f"br i1 {truth(condition)}, label %{check}, label %{on}")
        e.start(check)
        leaves = self.counter.check_changes(site, cycle, next_pc)
        e.end(f"br i1 {leaves}, label %{leave}, label %{on}")
        e.start(leave)
        if self.b.deferred.check_interrupts:
            e.store(pointer(e, self.layout.offset["events.deadline"]), 0, 64)
        self.v.leave(next_pc, CHANGED)
        e.start(on)

    def advance(self, pc: int, cycles: Number, mask: int, times: int = 1) -> None:
        """Advance the clock by the `cycles` of the instruction at `pc`, executed `times` times.

        `mask`: W registers written as destination, for RAW stalls of the next instruction.
        """
        self.v.set("cycle", self.v.get("cycle") + cycles)
        self.v.set("stall", mask)
        self.counter.add_cycles(pc, cycles)
        self.counter.count_execution(pc, times)
