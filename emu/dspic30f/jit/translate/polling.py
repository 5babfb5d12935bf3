"""Polling loops: waiting for something that only an event or an interrupt can change.

A loop is empty if an iteration leaves everything as the iteration before left it: it stores nothing, reads nothing that
time changes, and computes nothing from its own results. Then all iterations up to the next deadline are alike, and
whole ones can be skipped by adding their cycles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.isa.builder import Context, Size
from emu.dspic30f.isa.flow import Branch, Goto, Skip
from emu.dspic30f.jit.exit_reasons import Surroundings
from emu.dspic30f.jit.translate.builder import LlvmBuilder, NeedsInterpreter
from emu.dspic30f.jit.translate.region import Region, Step
from emu.dspic30f.jit.translate.values import Emitter, Number, Value
from emu.dspic30f.jit.translate.variables import Variables

LONGEST: Final = 12
"""Instructions in a loop that is looked at: polling loops are short."""


@dataclass(frozen=True)
class Loop:
    """An empty loop: it is entered at `head`, and its last instruction branches back."""

    head: int
    back: int
    costs: tuple[tuple[int, int], ...]
    """Its instructions and the Tcy of each."""

    @property
    def cycles(self) -> int:
        """Tcy of an iteration."""
        return sum(cycles for _, cycles in self.costs)


def empty_loops(region: Region, around: Surroundings, context: Context) -> dict[int, Loop]:
    """The empty loops of a region by the address of their last instruction."""
    loops = {}
    for pc, step in region.steps.items():
        if step.facts.flow in (Branch, Goto) and step.target is not None and step.target <= pc:
            loop = _empty_loop(region, step, around, context)
            if loop is not None:
                loops[pc] = loop
    return loops


def _empty_loop(region: Region, back: Step, around: Surroundings, context: Context) -> Loop | None:
    head = back.target
    assert head is not None
    path = _path(region, head, back.pc)
    if path is None or any(step.pc == around.do_end or step.pc in around.hooks for step in path):
        return None
    inside = range(head + 1, back.pc + 1)
    if any(step.target in inside for step in region.steps.values()):
        return None  # it can be entered behind its head
    try:
        costs = _costs(path, around, context)
    except NeedsInterpreter:
        return None
    return Loop(head, back.pc, costs)


def _path(region: Region, head: int, back: int) -> list[Step] | None:
    """The instructions from `head` to `back`, one behind the other."""
    path: list[Step] = []
    pc = head
    while pc <= back and len(path) < LONGEST:
        step = region.steps.get(pc)
        if step is None:
            return None
        path.append(step)
        pc = step.next_pc
    return path if path[-1].pc == back else None


def _costs(path: list[Step], around: Surroundings, context: Context) -> tuple[tuple[int, int], ...]:
    """Tcy of each instruction of an iteration. Raises NeedsInterpreter if iterations may differ."""
    probe = _Probe(around, context)
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
    if probe.notes.carried & probe.notes.changed:
        raise NeedsInterpreter
    return tuple(costs)


class _Notes(Variables):
    """Variables that remember which were read before they were written."""

    def __init__(self, emitter: Emitter, around: Surroundings) -> None:
        super().__init__(emitter, around.offset)
        self.carried: Final[set[str]] = set()
        self.changed: Final[set[str]] = set()

    def get(self, name: str) -> Value:
        """Note a read."""
        if name not in self.changed:
            self.carried.add(name)
        return super().get(name)

    def set(self, name: str, value: Number) -> None:
        """Note a write."""
        self.changed.add(name)
        super().set(name, value)


class _Probe(LlvmBuilder):
    """Translates a loop for nothing, to see what it touches."""

    def __init__(self, around: Surroundings, context: Context) -> None:
        emitter = Emitter()
        emitter.start("probe")
        self.notes: Final = _Notes(emitter, around)
        steady = {at: how for at, how in around.reads.items() if at not in around.rules}
        super().__init__(emitter, self.notes, replace(around, reads=steady, rules={}), context)

    def run(self, step: Step) -> object:
        """Translate an instruction; its flow."""
        self.begin(step.pc, 2)
        flow = step.insn.row.does(self, step.insn.x)  # type: ignore[arg-type]
        if self.pending.psv or self.pending.registers or self.pending.mapped:
            raise NeedsInterpreter
        self.commit()
        return flow

    def store(self, ea: Number, v: Number, size: Size, ptr: int | None = None) -> None:
        """An iteration with a store is not empty."""
        raise NeedsInterpreter

    def table_write(self, address: Number, byte_mask: Number, v: Number) -> None:
        """Nor is one that writes latches."""
        raise NeedsInterpreter
