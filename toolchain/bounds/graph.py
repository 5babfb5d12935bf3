"""Control-flow graphs of functions, and the order of their analysis: Bourdoncle's weak topological order (1993).

In this order every loop, reducible or not, is a component with a head.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from emu.dspic30f.isa.facts import facts_of, flow_of
from emu.dspic30f.isa.flow import Branch, Call, Do, Flow, Goto, Reset, Return, Skip
from emu.dspic30f.isa.row import Insn
from toolchain.elf.disassemble import CodeItem


@dataclass(frozen=True, slots=True)
class Instruction:
    """One instruction with its static facts."""

    pc: int
    insn: Insn
    after: int
    cycles: int
    pointers: int
    """Bit mask of registers used as source addresses (emu.dspic30f.isa.facts)."""
    writes: int
    window: int
    """Additional cycles of a PSV window read (isa.md §13.3)."""
    flow: type | None


@dataclass(slots=True)
class BasicBlock:
    """A basic block; `following` are the heads of its successors within the function."""

    steps: list[Instruction]
    following: list[int]
    flag_setter: int | None = None
    """Index of the instruction whose result the branch at the end tests (conditions.flag_setter_index)."""


@dataclass(slots=True)
class Loop:
    """A component of the weak topological order: its head, and its other elements in order."""

    head: int
    body: list[OrderElement]
    members: set[int]
    heads: set[int] = field(default_factory=set)
    """Starts of iterations: the head, and the heads of inner loops merged with this one."""


OrderElement = int | Loop


@dataclass(slots=True)
class FunctionGraph:
    """The control-flow graph of one function."""

    entry: int
    blocks: dict[int, BasicBlock] = field(default_factory=dict)
    order: list[OrderElement] = field(default_factory=list)
    heads: set[int] = field(default_factory=set)
    """Heads of loops."""
    missing_instructions: list[int] = field(default_factory=list)
    """Reachable addresses without an instruction."""
    tail_calls: dict[int, int] = field(default_factory=dict)
    """Jumps to other functions: address of the jump -> target."""
    do_ends: set[int] = field(default_factory=set)
    """Last instructions of DO loops."""
    has_frame: bool = False
    """Whether the function has a frame (LNK) that alloca can extend."""


def instruction_at(item: CodeItem) -> Instruction:
    """Return an instruction with its static facts."""
    assert item.insn is not None
    facts = facts_of(item.insn)
    row = item.insn.row
    window = 1 if row.psv_class == "mov" else 2
    after = item.address + 2 * len(item.words)
    return Instruction(
        item.address, item.insn, after, row.cycles, facts.source_pointers, facts.writes, window, facts.flow
    )


class GraphBuilder:
    """Builds the control-flow graphs of functions."""

    def __init__(self, items: Mapping[int, CodeItem], entries: set[int]) -> None:
        self.items, self.entries = items, entries
        self.steps: dict[int, Instruction] = {}

    def code(self, entry: int) -> FunctionGraph:
        """Return the graph of the function at `entry`."""
        result = FunctionGraph(entry)
        following, heads = self._walk(result)
        for head in sorted(heads):
            steps = [self.steps[head]]
            while (next_pc := self._falls(steps[-1], following)) is not None and next_pc not in heads:
                steps.append(self.steps[next_pc])
            result.blocks[head] = BasicBlock(steps, following[steps[-1].pc])
        result.order = weak_topological_order(entry, {head: block.following for head, block in result.blocks.items()})
        result.heads = {loop.head for loop in all_loops(result.order)}
        return result

    def _falls(self, step: Instruction, following: dict[int, list[int]]) -> int | None:
        return step.after if following[step.pc] == [step.after] and step.flow not in (Call, Goto) else None

    def _walk(self, result: FunctionGraph) -> tuple[dict[int, list[int]], set[int]]:
        """Return the successors of every instruction, and the first instructions of blocks."""
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
                result.missing_instructions.append(pc)
                following[pc] = []
                heads.discard(pc)
                continue
            step = self.steps.get(pc)
            if step is None:
                step = self.steps[pc] = instruction_at(item)
            targets = self._targets(result, step, flow_of(step.insn, pc), ends)
            following[pc] = targets
            if targets != [step.after] or step.flow in (Call, Goto):
                heads.update(targets)
            work += targets
        result.do_ends = set(ends)
        for end, start in ends.items():
            if end in following:
                following[end] = [*following[end], start]
                heads.update(following[end])
        for pc in result.missing_instructions:
            del following[pc]
        for pc in following:
            following[pc] = [t for t in following[pc] if t in following]
        return following, {h for h in heads if h in following}

    def _targets(self, result: FunctionGraph, step: Instruction, flow: Flow, ends: dict[int, int]) -> list[int]:
        match flow:
            case Branch(_, target):
                return [step.after, target]
            case Skip():
                skipped = self.items.get(step.after)
                return [step.after, step.after + 2 * (len(skipped.words) if skipped else 1)]
            case Goto(target) if isinstance(target, int):
                if target in self.entries and target != result.entry:
                    result.tail_calls[step.pc] = target
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
        """Return the entries of a jump table after BRA Wn: a sequence of BRA and RETLW (abi-elf.md §8.1)."""
        targets: list[int] = []
        while (item := self.items.get(address)) is not None and item.insn is not None:
            name = item.insn.row.mnemonic
            if not (name == "BRA" and "," not in item.insn.row.syntax) and name not in ("RETLW", "RETURN"):
                break
            targets.append(address)
            address += 2
        return targets


def weak_topological_order(entry: int, graph: Mapping[int, list[int]]) -> list[OrderElement]:
    """Return the weak topological order of the nodes reachable from `entry`."""
    number = dict.fromkeys(graph, 0)
    stack: list[int] = []
    count = 0

    def visit(node: int, order: list[OrderElement]) -> int:
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
        body: list[OrderElement] = []
        for child in graph[node]:
            if number[child] == 0:
                visit(child, body)
        members = {node}
        for part in body:
            members |= part.members if isinstance(part, Loop) else {part}
        return Loop(node, body, members, {node})

    order: list[OrderElement] = []
    if entry in graph:
        visit(entry, order)
    return order


def all_loops(order: list[OrderElement]) -> list[Loop]:
    """Return all loops, outer ones first."""
    found: list[Loop] = []
    for part in order:
        if isinstance(part, Loop):
            found += [part, *all_loops(part.body)]
    return found


def merge_loops(order: list[OrderElement], same: set[int]) -> list[OrderElement]:
    """Return the order with each loop whose head is in `same` merged with the enclosing loop."""
    result: list[OrderElement] = []
    for part in order:
        if isinstance(part, Loop):
            body: list[OrderElement] = []
            for inner in merge_loops(part.body, same):
                if isinstance(inner, Loop) and inner.head in same:
                    part.heads |= inner.heads
                    body += [inner.head, *inner.body]
                else:
                    body.append(inner)
            part.body = body
        result.append(part)
    return result
