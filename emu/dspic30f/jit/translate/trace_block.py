"""Trace blocks: instructions of one block, including jumps, and branches that skip only a few register instructions.

Such a branch or skip does not end its block: both paths join after the skipped instructions. No deadline check lies
between them, so LLVM converts the paths to selections, and the host cannot mispredict the branch. A jump continues with
a copy of the instructions at its target, which saves the deadline checks of the blocks there.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass
from typing import Final

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.isa.flow import Branch, Goto, Skip
from emu.dspic30f.jit.translate.region import Region, Step

MAX_SKIPPED: Final = 4
"""Maximum number of instructions that a branch within a block may skip; a selection always costs both paths."""
MAX_BRANCHES: Final = 4
"""Maximum number of branches within a block; code after them is translated again for other predecessors."""
MAX_COPIED: Final = 8
"""Maximum number of instructions behind a jump within a block; other predecessors have translations of their own."""


@dataclass(frozen=True, slots=True)
class TraceItem:
    """An instruction of a block. For a branch within the block, `skipped` holds the instructions that it skips."""

    step: Step
    skipped: tuple[Step, ...] = ()
    jumps: bool = False
    """Whether the item is a jump, and the block continues at its target."""

    @property
    def next_pc(self) -> int:
        """Return the address at which the block continues after the item."""
        target = self.step.target
        return target if target is not None and (self.skipped or self.jumps) else self.step.next_pc


def taken_cost(step: Step) -> int:
    """Return the additional cycles of a branch or skip if it is taken (isa.md §13.1)."""
    assert step.target is not None
    return flow_rules.TAKEN if step.facts.flow is Branch else (step.target - step.next_pc) // 2


def trace_block(
    region: Region, start: int, ends: Container[int], barriers: Container[int], last: int
) -> list[TraceItem]:
    """Return the block at `start`.

    It ends with a flow, with the instruction at `last`, or before an address in `ends`. A branch within it does not
    skip an instruction in `barriers`, and no jump within it leads to one.
    """
    items = list(_up_to_flow(region, start, ends, barriers, last))
    jump = items[-1].step
    target = jump.target
    if (
        jump.facts.flow is Goto
        and target is not None
        and jump.pc != last
        and target not in barriers
        and not start <= target <= jump.pc  # a loop is not unrolled
    ):
        copied = _copied(region, target, ends, barriers, last)
        if copied:
            items[-1:] = [TraceItem(jump, jumps=True), *copied]
    return items


def _up_to_flow(
    region: Region, start: int, ends: Container[int], barriers: Container[int], last: int
) -> Iterator[TraceItem]:
    """Yield the instructions from `start` to the next one at which a block ends, or before an address in `ends`."""
    pc, branches, joined = start, 0, start
    while (step := region.steps.get(pc)) is not None and (pc == joined or pc not in ends):
        item = TraceItem(step, tuple(_skipped(region, step, barriers, last)) if branches < MAX_BRANCHES else ())
        yield item
        if pc == last or (step.facts.flow is not None and not item.skipped):
            return
        pc = item.next_pc
        if item.skipped:
            branches, joined = branches + 1, pc


def _copied(
    region: Region, target: int, ends: Container[int], barriers: Container[int], last: int
) -> list[TraceItem]:
    """Return the instructions that a block copies from the target of its jump: whole blocks, at most MAX_COPIED."""
    copied: list[TraceItem] = []
    pc = target
    while pc in region.steps and pc not in barriers:
        block = list(_up_to_flow(region, pc, ends, barriers, last))
        if len(copied) + len(block) > MAX_COPIED:
            break
        copied += block
        end = block[-1].step
        if end.pc == last or end.facts.flow is not None:
            break
        pc = block[-1].next_pc
    return copied


def _skipped(region: Region, branch: Step, barriers: Container[int], last: int) -> Iterator[Step]:
    """Yield the instructions that a branch or skip skips; nothing if the branch must end its block."""
    target = branch.target
    if branch.facts.flow not in (Branch, Skip) or target is None or target not in region.steps or target in barriers:
        return
    pc = branch.next_pc
    skipped: list[Step] = []
    while pc < target and len(skipped) < MAX_SKIPPED:
        step = region.steps.get(pc)
        if step is None or pc in barriers or pc == last or not _is_register_only(step):
            return
        skipped.append(step)
        pc = step.next_pc
    if pc == target:
        yield from skipped


def _is_register_only(step: Step) -> bool:
    """Return whether an instruction accesses only registers."""
    facts = step.facts
    return facts.flow is None and not (facts.loads or facts.stores or facts.source_pointers)
