"""Regions: sets of instructions that are translated together, reachable from one address through static successors.

Calls, returns and computed jumps leave the region. Leaders are the addresses at which native code can be entered. A
block extends from one leader to the next.
"""

from __future__ import annotations

from collections.abc import Callable, Container
from dataclasses import dataclass, field
from typing import Final

from emu.dspic30f.interpreter.flow_rules import words_skipped
from emu.dspic30f.isa.facts import Facts, facts_of, flow_of
from emu.dspic30f.isa.flow import (
    PC_MASK,
    Branch,
    Call,
    ClearWatchdog,
    Disi,
    Do,
    Goto,
    Repeat,
    Reset,
    Return,
    Skip,
    Sleep,
)
from emu.dspic30f.isa.row import Insn

LIMIT: Final = 150
"""Maximum number of instructions in a region. Larger regions compile more slowly per instruction (engines.md §4.3)."""

Fetch = Callable[[int], Insn | None]
"""Function that returns the decoded instruction at a program address, None if there is no legal one."""


@dataclass(frozen=True, slots=True)
class Step:
    """One instruction of a region: its address, and the addresses inside the region that may follow it."""

    pc: int
    insn: Insn
    facts: Facts
    next_pc: int
    target: int | None
    """Target of a branch or jump, or the address after a skipped instruction; None if it is computed at run time."""


@dataclass
class Region:
    """Instructions by address, and the leaders among their addresses."""

    start: int
    steps: dict[int, Step] = field(default_factory=dict)
    leaders: set[int] = field(default_factory=set)

    def words(self) -> list[tuple[int, int, int]]:
        """Return (address, word 1, word 2) of each instruction; these program words determine the translation."""
        return [(pc, step.insn.word1, step.insn.word2) for pc, step in sorted(self.steps.items())]


def static_target(pc: int, insn: Insn, fetch: Fetch) -> int | None:
    """Return the target of a branch, jump or skip that the instruction encodes; None if it is computed at run time."""
    flow = flow_of(insn, pc)
    if isinstance(flow, Skip):
        skipped = fetch((pc + 2) & PC_MASK)
        return None if skipped is None else (pc + 2 + 2 * words_skipped(skipped)) & PC_MASK
    if isinstance(flow, (Branch, Goto)) and isinstance(flow.target, int):
        return flow.target & PC_MASK
    return None


ENDS: Final = (Goto, Call, Return, Reset, Sleep)
"""Flows after which execution never continues with the next word."""


def discover(start: int, fetch: Fetch, known: Container[int] = (), hooks: Container[int] = ()) -> Region:
    """Return the region entered at `start`. It ends at addresses in `known`, which already have code.

    Addresses in `hooks` become leaders, because native code is left and entered there.
    """

    region = Region(start)
    work = [start]
    region.leaders.add(start)
    while work and len(region.steps) < LIMIT:
        pc = work.pop(0)
        while pc not in region.steps and len(region.steps) < LIMIT and (pc == start or pc not in known):
            insn = fetch(pc)
            if insn is None:
                break
            facts = facts_of(insn)
            next_pc = (pc + 2 * insn.words) & PC_MASK
            target = static_target(pc, insn, fetch)
            region.steps[pc] = Step(pc, insn, facts, next_pc, target)
            if pc in hooks:
                region.leaders.add(pc)
            if target is not None:
                region.leaders.add(target)
                work.append(target)
            if facts.flow in (Branch, Skip, Call, Sleep, Disi, ClearWatchdog, Do):
                region.leaders.add(next_pc)
                work.append(next_pc)
            if facts.flow in ENDS or facts.flow in (Branch, Skip):
                break
            if facts.flow is Repeat:
                region.leaders.add(next_pc)
            pc = next_pc
    region.leaders &= set(region.steps)
    return region
