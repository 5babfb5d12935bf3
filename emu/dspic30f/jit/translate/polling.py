"""Polling loops: loops that wait for a change which only an event or an interrupt can make.

A loop is empty if every iteration leaves the same state as the previous one. It stores nothing, reads nothing that
changes with time, and computes nothing from its own results. All its iterations before the next deadline are equal, so
native code skips whole iterations by adding their cycles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.isa.builder import Context, Size
from emu.dspic30f.isa.flow import Branch, Goto, Skip
from emu.dspic30f.jit.ir.builder import LlvmBuilder, NeedsInterpreter
from emu.dspic30f.jit.ir.values import Emitter, Number, Value
from emu.dspic30f.jit.ir.variables import Variables
from emu.dspic30f.jit.machine_layout import MachineLayout
from emu.dspic30f.jit.translate.region import Region, Step

MAX_LOOP: Final = 12
"""Maximum number of instructions in a loop that is examined; polling loops are short."""


@dataclass(frozen=True)
class EmptyLoop:
    """An empty loop, entered at `head`. Its last instruction, at `back`, branches to `head`."""

    head: int
    back: int
    costs: tuple[tuple[int, int], ...]
    """(address, cycles) of each instruction, in Tcy."""

    @property
    def cycles(self) -> int:
        """Return the cycles of one iteration in Tcy."""
        return sum(cycles for _, cycles in self.costs)


def empty_loops(region: Region, layout: MachineLayout, context: Context) -> dict[int, EmptyLoop]:
    """Return the empty loops of a region, by the address of their last instruction."""
    loops = {}
    for pc, step in region.steps.items():
        if step.facts.flow in (Branch, Goto) and step.target is not None and step.target <= pc:
            loop = _empty_loop(region, step, layout, context)
            if loop is not None:
                loops[pc] = loop
    return loops


def _empty_loop(region: Region, back: Step, layout: MachineLayout, context: Context) -> EmptyLoop | None:
    head = back.target
    assert head is not None
    path = _path(region, head, back.pc)
    if path is None or any(step.pc == layout.do_end or step.pc in layout.hooks for step in path):
        return None
    inside = range(head + 1, back.pc + 1)
    if any(step.target in inside for step in region.steps.values()):
        return None  # the loop can be entered in the middle
    try:
        costs = _costs(path, layout, context)
    except NeedsInterpreter:
        return None
    return EmptyLoop(head, back.pc, costs)


def _path(region: Region, head: int, back: int) -> list[Step] | None:
    """Return the instructions from `head` to `back` in address order; None if they are not one straight path."""
    path: list[Step] = []
    pc = head
    while pc <= back and len(path) < MAX_LOOP:
        step = region.steps.get(pc)
        if step is None:
            return None
        path.append(step)
        pc = step.next_pc
    return path if path[-1].pc == back else None


def _costs(path: list[Step], layout: MachineLayout, context: Context) -> tuple[tuple[int, int], ...]:
    """Return (address, cycles) of each instruction in an iteration.

    Raises NeedsInterpreter if iterations may differ.
    """
    probe = _LoopProbe(layout, context)
    costs, written = [], path[-1].facts.writes
    for step in path:
        last = step is path[-1]
        flow = probe.run(step)
        allowed = (Branch, Goto) if last else (type(None), Branch, Skip)
        if not isinstance(flow, allowed) or (flow is not None and not last and step.target is None):
            raise NeedsInterpreter
        stall = flow_rules.stall(written, step.facts.source_pointers)
        costs.append((step.pc, step.insn.row.cycles + stall + flow_rules.TAKEN * (last and isinstance(flow, Branch))))
        written = step.facts.writes
    if probe.variables.read_first & probe.variables.written:
        raise NeedsInterpreter
    return tuple(costs)


class _RecordingVariables(Variables):
    """Variables that record which of them are read before written, and which are written."""

    def __init__(self, emitter: Emitter, layout: MachineLayout) -> None:
        super().__init__(emitter, layout.offset)
        self.read_first: Final[set[str]] = set()
        """Names of variables that were read before they were written."""
        self.written: Final[set[str]] = set()

    def get(self, name: str) -> Value:
        """Return a variable and record the read."""
        if name not in self.written:
            self.read_first.add(name)
        return super().get(name)

    def set(self, name: str, value: Number) -> None:
        """Assign a variable and record the write."""
        self.written.add(name)
        super().set(name, value)


class _LoopProbe(LlvmBuilder):
    """Builder that translates a loop into a scratch block to determine what the loop accesses."""

    def __init__(self, layout: MachineLayout, context: Context) -> None:
        emitter = Emitter()
        emitter.start("probe")
        self.variables: Final = _RecordingVariables(emitter, layout)
        steady = {at: how for at, how in layout.reads.items() if at not in layout.rules}
        super().__init__(emitter, self.variables, replace(layout, reads=steady, rules={}), context)

    def run(self, step: Step) -> object:
        """Translate an instruction and return its flow."""
        self.begin(step.pc, 2)
        flow = step.insn.row.does(self, step.insn.x)  # type: ignore[arg-type]
        if self.deferred.psv_reads or self.deferred.registers or self.deferred.mapped_w:
            raise NeedsInterpreter
        self.commit()
        return flow

    def store(self, ea: Number, v: Number, size: Size, ptr: int | None = None) -> None:
        """Raise NeedsInterpreter, because a loop with a store is not empty."""
        raise NeedsInterpreter

    def table_write(self, address: Number, byte_mask: Number, v: Number) -> None:
        """Raise NeedsInterpreter, because a loop that writes latches is not empty."""

        raise NeedsInterpreter
