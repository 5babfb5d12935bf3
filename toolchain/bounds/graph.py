"""Functions of an image as blocks, and the order in which to visit them: Bourdoncle's weak topological order (1993), in
which every loop, reducible or not, is a component with a head."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from emu.dspic30f.isa.facts import facts_of, flow_of
from emu.dspic30f.isa.flow import Branch, Call, Do, Flow, Goto, Reset, Return, Skip
from emu.dspic30f.isa.row import Insn
from toolchain.elf.disassemble import Item


@dataclass(frozen=True, slots=True)
class Step:
    """One instruction, with what stays the same however often it runs."""

    pc: int
    insn: Insn
    after: int
    cycles: int
    pointers: int
    """Registers it forms source addresses from (emu.dspic30f.isa.facts)."""
    writes: int
    window: int
    """Cycles a read of the PSV window adds (isa.md §13.3)."""
    flow: type | None


@dataclass(slots=True)
class Block:
    """Instructions that run one after the other; `following` are the blocks of the same function behind it."""

    steps: list[Step]
    following: list[int]
    tested: int | None = None
    """Which step left the result that the branch at the end asks about (compare.tested)."""


@dataclass(slots=True)
class Loop:
    """A component: its head, and everything else of it in order."""

    head: int
    body: list[Order]
    members: set[int]
    heads: set[int] = field(default_factory=set)
    """Where its rounds begin: its head, and those of loops within that are the same loop of the source."""


Order = int | Loop


@dataclass(slots=True)
class Code:
    """One function."""

    entry: int
    blocks: dict[int, Block] = field(default_factory=dict)
    order: list[Order] = field(default_factory=list)
    heads: set[int] = field(default_factory=set)
    """Heads of loops."""
    lost: list[int] = field(default_factory=list)
    """Addresses it leads to where no instruction is."""
    tails: dict[int, int] = field(default_factory=dict)
    """Jumps to other functions: place -> target."""
    ends: set[int] = field(default_factory=set)
    """Last instructions of DO loops."""
    framed: bool = False
    """It has a frame of its own (LNK), in which alloca takes room."""


def step_at(item: Item) -> Step:
    """What the explorer needs of an instruction."""
    assert item.insn is not None
    facts = facts_of(item.insn)
    row = item.insn.row
    window = 1 if row.psv_class == "mov" else 2
    after = item.address + 2 * len(item.words)
    return Step(item.address, item.insn, after, row.cycles, facts.source_pointers, facts.writes, window, facts.flow)


class Builder:
    """Makes `Code` of what starts at an address."""

    def __init__(self, items: Mapping[int, Item], entries: set[int]) -> None:
        self.items, self.entries = items, entries
        self.steps: dict[int, Step] = {}

    def code(self, entry: int) -> Code:
        """The function at `entry`."""
        result = Code(entry)
        following, heads = self._walk(result)
        for head in sorted(heads):
            steps = [self.steps[head]]
            while (next_pc := self._falls(steps[-1], following)) is not None and next_pc not in heads:
                steps.append(self.steps[next_pc])
            result.blocks[head] = Block(steps, following[steps[-1].pc])
        result.order = ordered(entry, {head: block.following for head, block in result.blocks.items()})
        result.heads = {loop.head for loop in loops_in(result.order)}
        return result

    def _falls(self, step: Step, following: dict[int, list[int]]) -> int | None:
        return step.after if following[step.pc] == [step.after] and step.flow not in (Call, Goto) else None

    def _walk(self, result: Code) -> tuple[dict[int, list[int]], set[int]]:
        """Successors of every instruction, and the first instructions of blocks."""
        following: dict[int, list[int]] = {}
        heads = {result.entry}
        ends: dict[int, int] = {}
        work = [result.entry]
        while work:
            pc = work.pop()
            if pc in following:
                continue
            item = self.items.get(pc)
            if item is None or item.insn is None:
                result.lost.append(pc)
                following[pc] = []
                heads.discard(pc)
                continue
            step = self.steps.get(pc)
            if step is None:
                step = self.steps[pc] = step_at(item)
            targets = self._targets(result, step, flow_of(step.insn, pc), ends)
            following[pc] = targets
            if targets != [step.after] or step.flow in (Call, Goto):
                heads.update(targets)
            work += targets
        result.ends = set(ends)
        for end, start in ends.items():
            if end in following:
                following[end] = [*following[end], start]
                heads.update(following[end])
        for pc in result.lost:
            del following[pc]
        for pc in following:
            following[pc] = [t for t in following[pc] if t in following]
        return following, {h for h in heads if h in following}

    def _targets(self, result: Code, step: Step, flow: Flow, ends: dict[int, int]) -> list[int]:
        match flow:
            case Branch(_, target):
                return [step.after, target]
            case Skip():
                skipped = self.items.get(step.after)
                return [step.after, step.after + 2 * (len(skipped.words) if skipped else 1)]
            case Goto(target) if isinstance(target, int):
                if target in self.entries and target != result.entry:
                    result.tails[step.pc] = target
                    return []
                return [target]
            case Goto():
                return self.table(step.after) if step.insn.row.mnemonic == "BRA" else []
            case Return() | Reset():
                return []
            case Do(_, end):
                ends[end] = step.after
        return [step.after]

    def table(self, address: int) -> list[int]:
        """Entries of a jump table behind BRA Wn: a run of BRA and RETLW (abi-elf.md §8.1)."""
        targets: list[int] = []
        while (item := self.items.get(address)) is not None and item.insn is not None:
            name = item.insn.row.mnemonic
            if not (name == "BRA" and "," not in item.insn.row.syntax) and name not in ("RETLW", "RETURN"):
                break
            targets.append(address)
            address += 2
        return targets


def ordered(entry: int, graph: Mapping[int, list[int]]) -> list[Order]:
    """The weak topological order of what can be reached from `entry`."""
    number = dict.fromkeys(graph, 0)
    stack: list[int] = []
    count = 0

    def visit(node: int, order: list[Order]) -> int:
        nonlocal count
        stack.append(node)
        count += 1
        head = number[node] = count
        loops = False
        for child in graph[node]:
            least = visit(child, order) if number[child] == 0 else number[child]
            if least <= head:
                head, loops = least, True
        if head == number[node]:
            number[node] = 1 << 60
            member = stack.pop()
            if loops:
                while member != node:
                    number[member] = 0
                    member = stack.pop()
                order.insert(0, component(node))
            else:
                order.insert(0, node)
        return head

    def component(node: int) -> Loop:
        body: list[Order] = []
        for child in graph[node]:
            if number[child] == 0:
                visit(child, body)
        members = {node}
        for part in body:
            members |= part.members if isinstance(part, Loop) else {part}
        return Loop(node, body, members, {node})

    order: list[Order] = []
    if entry in graph:
        visit(entry, order)
    return order


def loops_in(order: list[Order]) -> list[Loop]:
    """All loops, outer ones first."""
    found: list[Loop] = []
    for part in order:
        if isinstance(part, Loop):
            found += [part, *loops_in(part.body)]
    return found


def joined(order: list[Order], same: set[int]) -> list[Order]:
    """The order with each loop whose head is in `same` made one with the loop around it."""
    result: list[Order] = []
    for part in order:
        if isinstance(part, Loop):
            body: list[Order] = []
            for inner in joined(part.body, same):
                if isinstance(inner, Loop) and inner.head in same:
                    part.heads |= inner.heads
                    body += [inner.head, *inner.body]
                else:
                    body.append(inner)
            part.body = body
        result.append(part)
    return result


__all__ = ["Block", "Builder", "Code", "Loop", "Order", "Step", "joined", "loops_in", "ordered", "step_at"]
