"""What one block runs: instructions one behind the other, and past branches that only go round a few of them.

A branch or skip round instructions that compute in registers is no end of a block: both ways go on behind it. Without
a look at the deadline between, LLVM makes selections of them, and a host that cannot guess such a branch need not.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass
from typing import Final

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.isa.flow import Branch, Skip
from emu.dspic30f.jit.translate.region import Region, Step

ARM: Final = 4
"""Instructions a branch may go round: selecting costs what they cost, each time."""
ARMS: Final = 4
"""Branches in one block: what is behind them is translated once more for who comes from elsewhere."""


@dataclass(frozen=True, slots=True)
class Part:
    """An instruction, and those it goes round if it is a branch or skip that does not end the block."""

    step: Step
    arm: tuple[Step, ...] = ()

    @property
    def next_pc(self) -> int:
        """Where the block goes on."""
        return self.step.target if self.arm and self.step.target is not None else self.step.next_pc


def extra(step: Step) -> int:
    """Cycles that a branch or skip takes longer if it is taken (isa.md §13.1)."""
    assert step.target is not None
    return flow_rules.TAKEN if step.facts.flow is Branch else (step.target - step.next_pc) // 2


def course(region: Region, start: int, ends: Container[int], apart: Container[int], last: int) -> list[Part]:
    """The block at `start`: up to a flow, to `last`, or to one of `ends`; nothing that is in `apart` is gone past."""
    parts: list[Part] = []
    pc, arms, joined = start, 0, start
    while (step := region.steps.get(pc)) is not None and (pc == joined or pc not in ends):
        part = Part(step, tuple(_arm(region, step, apart, last)) if arms < ARMS else ())
        parts.append(part)
        if pc == last or (step.facts.flow is not None and not part.arm):
            break
        pc = part.next_pc
        if part.arm:
            arms, joined = arms + 1, pc
    return parts


def _arm(region: Region, branch: Step, apart: Container[int], last: int) -> Iterator[Step]:
    """What a branch or skip goes round; nothing if it cannot stay in the block."""
    target = branch.target
    if branch.facts.flow not in (Branch, Skip) or target is None or target not in region.steps or target in apart:
        return
    pc = branch.next_pc
    arm: list[Step] = []
    while pc < target and len(arm) < ARM:
        step = region.steps.get(pc)
        if step is None or pc in apart or pc == last or not _computes(step):
            return
        arm.append(step)
        pc = step.next_pc
    if pc == target:
        yield from arm


def _computes(step: Step) -> bool:
    """Whether an instruction touches nothing but registers."""
    facts = step.facts
    return facts.flow is None and not (facts.loads or facts.stores or facts.source_pointers)
