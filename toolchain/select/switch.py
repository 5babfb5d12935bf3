"""Lowering of switches to compare chains, binary search or branch tables, chosen by size.

A chain costs 2 words per case (CP #lit5, BRA; 3 with a large constant). A table costs a range check, BRA Wn and one BRA
per value of its range (abi-elf.md §8.1).
"""

from __future__ import annotations

from toolchain.ir.build import IrBuilder, const
from toolchain.ir.cfg import new_branch, retarget_phis
from toolchain.ir.model import I16, VOID, Block, Function, Instr, Value

TABLE_OVERHEAD_WORDS = 5
CHAIN_WORDS = 2
CaseRange = tuple[int, int, str]  # (first value, last value, target)


class SwitchLowering:
    """Lowering of one switch; collects the new blocks and the predecessors of the targets."""

    def __init__(self, blocks: dict[str, Block], block: Block, for_size: bool) -> None:
        self.blocks = blocks
        self.block = block
        self.switch = block.instrs.pop()
        self.value = self.switch.args[0]
        self.default = self.switch.blocks[0]
        self.longest_chain = 10 if for_size else 4
        self.start = block
        self.new_blocks: list[Block] = []
        self.edges: dict[str, list[str]] = {}

    def run(self) -> list[Block]:
        """Replace the switch; return the added blocks in layout order."""
        cases = self.switch.extra["cases"]
        pairs = sorted(zip(cases, self.switch.blocks[1:], strict=True))
        pairs = [(k, t) for k, t in pairs if t != self.default]
        if self.value.type.bits > 16 and pairs:
            pairs = self._narrow(pairs)
        self._search(self.start, _case_ranges(pairs), 0, (1 << self.value.type.bits) - 1)
        for target in dict.fromkeys(self.switch.blocks):
            retarget_phis(self.blocks[target], self.block.name, self.edges.get(target, []))
        return self.new_blocks

    def _narrow(self, pairs: list[tuple[int, str]]) -> list[tuple[int, str]]:
        """If the cases of a wide value span at most a word, check the range once and continue with the low word."""
        base, top = pairs[0][0], pairs[-1][0]
        if top - base > 0xFFFF or len(pairs) < 3:
            return pairs
        b = IrBuilder(self.block)
        b.line = self.switch.line
        shifted = b.binary("sub", self.value, const(self.value.type, base))
        inside = b.icmp("ule", shifted, const(shifted.type, top - base))
        rest = self._block()
        self._branch(self.block, inside, rest.name, self.default)
        self.start = rest
        b.block = rest
        self.value = b.cast("trunc", shifted, I16)
        return [(k - base, t) for k, t in pairs]

    def _block(self) -> Block:
        block = Block(f"{self.block.name}.s{len(self.new_blocks)}")
        self.new_blocks.append(block)
        return block

    def _edge(self, source: str, target: str) -> None:
        sources = self.edges.setdefault(target, [])
        if source not in sources:
            sources.append(source)

    def _branch(self, block: Block, c: Value, yes: str, no: str) -> None:
        i = Instr("br", VOID, [c])
        i.blocks = [yes, no]
        i.line = self.switch.line
        block.instrs.append(i)
        self._edge(block.name, yes)
        self._edge(block.name, no)

    def _jump(self, block: Block, target: str) -> None:
        i = new_branch(target)
        i.line = self.switch.line
        block.instrs.append(i)
        self._edge(block.name, target)

    def _search(self, block: Block, ranges: list[CaseRange], low: int, high: int) -> None:
        """Build code for the cases `ranges`; the value is known to be in low..high."""
        if not ranges:
            self._jump(block, self.default)
        elif self._wants_table(ranges):
            self._table(block, ranges, low, high)
        elif len(ranges) <= self.longest_chain:
            self._chain(block, ranges, low, high)
        else:
            middle = len(ranges) // 2
            pivot = ranges[middle][0]
            left, right = self._block(), self._block()
            b = IrBuilder(block)
            b.line = self.switch.line
            self._branch(block, b.icmp("ult", self.value, const(self.value.type, pivot)), left.name, right.name)
            self._search(left, ranges[:middle], low, pivot - 1)
            self._search(right, ranges[middle:], pivot, high)

    def _wants_table(self, ranges: list[CaseRange]) -> bool:
        span = ranges[-1][1] - ranges[0][0] + 1
        chain = sum(CHAIN_WORDS + (first > 31) + (2 if last > first else 0) for first, last, _ in ranges)
        return len(ranges) > 3 and span + TABLE_OVERHEAD_WORDS <= chain and self.value.type.bits <= 16

    def _chain(self, block: Block, ranges: list[CaseRange], low: int, high: int) -> None:
        t = self.value.type
        for k, (first, last, target) in enumerate(ranges):
            b = IrBuilder(block)
            b.line = self.switch.line
            if first <= low and last >= high:
                self._jump(block, target)
                return
            if first == last:
                test = b.icmp("eq", self.value, const(t, first))
            elif first == 0:
                test = b.icmp("ule", self.value, const(t, last))
            else:
                test = b.icmp("ule", b.binary("sub", self.value, const(t, first)), const(t, last - first))
            final = k == len(ranges) - 1
            next_block = self.default if final else self._block().name
            self._branch(block, test, target, next_block)
            if not final:
                block = self.new_blocks[-1]

    def _table(self, block: Block, ranges: list[CaseRange], low: int, high: int) -> None:
        base, top = ranges[0][0], ranges[-1][1]
        b = IrBuilder(block)
        b.line = self.switch.line
        index = b.cast("zext", self.value, I16) if self.value.type.bits < 16 else self.value
        if 0 < base <= 2 and low == 0 and top - base > 3:
            base = 0  # one or two additional table words are cheaper than the subtraction
        if base:
            index = b.binary("sub", index, const(I16, base))
        if low < base or high > top:
            inside = b.icmp("ule", index, const(I16, top - base))
            table = self._block()
            self._branch(block, inside, table.name, self.default)
            block = table
        targets = [self.default] * (top - base + 1)
        for first, last, target in ranges:
            for k in range(first, last + 1):
                targets[k - base] = target
        i = Instr("brtable", VOID, [index])
        i.blocks = targets
        i.line = self.switch.line
        block.instrs.append(i)
        for target in targets:
            self._edge(block.name, target)


def _case_ranges(pairs: list[tuple[int, str]]) -> list[CaseRange]:
    """Merge adjacent values with one target."""
    ranges: list[CaseRange] = []
    for k, target in pairs:
        if ranges and ranges[-1][1] == k - 1 and ranges[-1][2] == target:
            ranges[-1] = (ranges[-1][0], k, target)
        else:
            ranges.append((k, k, target))
    return ranges


def lower_switches(f: Function, for_size: bool) -> None:
    """Replace every switch of the function. Ensures: terminators are br, brtable, indirectbr, ret and unreachable."""
    out: list[Block] = []
    blocks = {b.name: b for b in f.blocks}
    for block in list(f.blocks):
        out.append(block)
        if block.instrs[-1].op == "switch":
            out += SwitchLowering(blocks, block, for_size).run()
    f.blocks = out
