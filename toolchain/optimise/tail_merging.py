"""Tail merging: replaces the common ending of blocks with the same successor by one copy.

The common ending becomes a new block; the merged blocks branch to it instead of the successor. Needs: frames built,
explicit branches.
"""

from __future__ import annotations

from dataclasses import replace

from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import MEMORY

ENDS = {"ret", "tailcall"}


def run(m: MFunction) -> None:
    """Merge endings until no merge saves a word."""
    serial = 0
    while True:
        group = _best_group(m)
        if group is None:
            return
        blocks, length, closed = group
        serial += 1
        _merge(m, blocks, length, closed, f"{blocks[0].name}.tail{serial}")


def _signature(mi: MI) -> tuple[object, ...]:
    """Key that is equal for instructions with the same effect; numbers of volatile accesses are ignored."""
    args = tuple(replace(a, volatile=1) if isinstance(a, MEMORY) and a.volatile else a for a in mi.args)
    return (mi.op, args, mi.byte, mi.cc, mi.pred, mi.text, mi.also_uses, mi.also_defs)


def _ending(b: MBlock) -> tuple[object, ...] | None:
    """Key of the last instruction: target of a jump, or kind of return; None for other blocks."""
    if not b.insts or (b.address_taken and len(b.insts) < 2):
        return None
    last = b.insts[-1]
    if last.op == "jump" and (len(b.insts) < 2 or b.insts[-2].op != "bra"):
        return ("jump", last.args[0])
    return _signature(last) if last.op in ENDS else None


def _best_group(m: MFunction) -> tuple[list[MBlock], int, bool] | None:
    """The merge that saves the most words: blocks, length of the common ending without jump, whether it returns."""
    endings: dict[tuple[object, ...], list[MBlock]] = {}
    for b in m.blocks:
        key = _ending(b)
        if key is not None:
            endings.setdefault(key, []).append(b)
    best: tuple[int, list[MBlock], int, bool] | None = None
    for key, blocks in endings.items():
        closed = key[0] != "jump"
        for group, length in _groups(blocks, closed):
            gain = length * (len(group) - 1) - (len(group) - 1 if closed else 0)
            if gain > 0 and (best is None or gain > best[0]):
                best = (gain, group, length, closed)
    return best[1:] if best is not None else None


def _groups(blocks: list[MBlock], closed: bool) -> list[tuple[list[MBlock], int]]:
    """Groups of blocks with the same last instruction, with the length of their common ending."""
    skip = 0 if closed else 1
    by_last: dict[tuple[object, ...], list[MBlock]] = {}
    for b in blocks:
        at = len(b.insts) - 1 - skip
        if at >= 0:
            by_last.setdefault(_signature(b.insts[at]), []).append(b)
    out = []
    for group in by_last.values():
        if len(group) > 1:
            length = _common(group, skip)
            if length:
                out.append((group, length))
    return out


def _common(group: list[MBlock], skip: int) -> int:
    """Length of the common ending before the jump; a skip is not separated from its instructions and its test."""
    length = 0
    shortest = min(len(b.insts) for b in group) - skip
    while length < shortest:
        first = group[0].insts[-1 - skip - length]
        if any(_signature(b.insts[-1 - skip - length]) != _signature(first) for b in group[1:]):
            break
        length += 1
    end = len(group[0].insts) - skip
    while length and _depends_on_predecessor(group[0].insts[end - length : end]):
        length -= 1
    return length


def _depends_on_predecessor(insts: list[MI]) -> bool:
    """Whether instructions cannot start a block: the first is covered by a skip, or they read flags set before them."""
    if insts[0].pred or insts[0].op in ("bra", "jump"):
        return True
    written: set[str] = set()
    for mi in insts:
        if set(mi.flags_read()) - written:
            return True
        written |= set(mi.flags_written())
    return False


def _merge(m: MFunction, blocks: list[MBlock], length: int, closed: bool, name: str) -> None:
    """Move the common ending of `blocks` to a new block."""
    skip = 0 if closed else 1
    keeper = blocks[0]
    cut = len(keeper.insts) - skip - length
    shared = MBlock(name, keeper.insts[cut:], list(keeper.succs), keeper.depth)
    for b in blocks:
        line = b.insts[-1].line
        del b.insts[len(b.insts) - skip - length :]
        b.insts.append(MI("jump", name, line=line))
        b.succs = [name]
    m.blocks.insert(m.blocks.index(keeper) + 1, shared)
