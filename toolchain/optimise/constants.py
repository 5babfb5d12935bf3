"""Sharing of constants in registers: loaded once for several uses in a block, and once before a loop.

Needs: virtual registers. A shared constant has a single definition, so the allocator can rematerialise it (`spill`).
"""

from __future__ import annotations

from functools import reduce
from operator import or_

from toolchain.ir.cfg import natural_loops
from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.liveness import live_out
from toolchain.mir.operands import Imm

REACH = 12  # maximum number of instructions between two uses of a shared constant
LOOP_REGISTERS = 9  # maximum number of registers live in a loop including its constants: W0-W7 and one more
LoadKey = tuple[str, object]


def run(m: MFunction) -> None:
    """Share constants in blocks, then hoist them from loops."""
    counts = _definition_counts(m)
    out = live_out(m)
    for b in m.blocks:
        _share_in_block(b, counts, out[b.name])
    _hoist_from_loops(m, counts)


def _definition_counts(m: MFunction) -> dict[int, int]:
    counts: dict[int, int] = {}
    for b in m.blocks:
        for mi in b.insts:
            for r in mi.defs():
                counts[r] = counts.get(r, 0) + 1
    return counts


def _key(mi: MI, counts: dict[int, int]) -> LoadKey | None:
    """Operation and value of a constant load; None for others, and if the register has another definition."""
    if mi.pred or mi.byte or not mi.args or not isinstance(mi.args[-1], int):
        return None
    if mi.args[-1] < 16 or counts.get(mi.args[-1]) != 1:
        return None
    if mi.op in ("clr", "setm"):
        return mi.op, None
    if mi.op == "mov" and isinstance(mi.args[0], Imm):
        return "mov", mi.args[0].value
    if mi.op == "lea":
        return "lea", mi.args[0]
    return None


def _is_call(mi: MI) -> bool:
    return mi.op in ("call", "callr", "asm")


def _share_in_block(b: MBlock, counts: dict[int, int], live: int) -> None:
    """Reuse the register of an equal constant loaded at most REACH instructions before, in place of a load that is
    not in `live`."""
    known: dict[LoadKey, tuple[int, int]] = {}
    rename: dict[int, int] = {}
    out: list[MI] = []
    for at, mi in enumerate(b.insts):
        if _is_call(mi):
            known.clear()
        key = _key(mi, counts)
        if key is not None:
            r = mi.register(-1)
            found = known.get(key)
            if found is not None and at - found[1] <= REACH and not live >> r & 1:
                rename[r] = found[0]
                known[key] = (found[0], at)
                continue
            known[key] = (r, at)
        elif rename:
            mi.map_registers(rename)
        out.append(mi)
    b.insts = out


def _hoist_from_loops(m: MFunction, counts: dict[int, int]) -> None:
    """Move the constants of innermost loops without calls to the block before the loop."""
    succs = {b.name: b.succs for b in m.blocks}
    loops = natural_loops(succs, m.blocks[0].name)
    blocks = m.block_map()
    out = None
    used: dict[str, int] = {}
    """Bit set of the registers that each block reads."""
    for header, body in sorted(loops.items(), key=lambda e: len(e[1])):
        if any(other != header and other in body for other in loops):
            continue
        if any(_is_call(mi) for n in body for mi in blocks[n].insts):
            continue
        entry = _entry(blocks, succs, header, body)
        if entry is None:
            continue
        if out is None:
            out = live_out(m)
            used = {b.name: _registers_read(b) for b in m.blocks}
        room = LOOP_REGISTERS - max(out[n].bit_count() for n in body) - 2
        outside = reduce(or_, (read for name, read in used.items() if name not in body), 0)
        inside = [blocks[n] for n in succs if n in body]
        _hoist(entry, inside, counts, room, outside)
        used |= {b.name: _registers_read(b) for b in inside}


def _entry(blocks: dict[str, MBlock], succs: dict[str, list[str]], header: str, body: set[str]) -> MBlock | None:
    """The only predecessor of a loop outside it, if the loop is the only successor of that block; else None."""
    outside = [n for n, s in succs.items() if header in s and n not in body]
    if len(outside) != 1 or succs[outside[0]] != [header]:
        return None
    return blocks[outside[0]]


def _registers_read(b: MBlock) -> int:
    """Bit set of the registers that a block reads."""
    return reduce(or_, (mi.register_sets()[0] for mi in b.insts), 0)


def _hoist(entry: MBlock, body: list[MBlock], counts: dict[int, int], room: int, outside: int) -> None:
    """Move constants of a loop to `entry`, except those in registers that code outside the loop reads (`outside`)."""
    found: dict[LoadKey, int] = {}
    rename: dict[int, int] = {}
    for b in body:
        kept: list[MI] = []
        for mi in b.insts:
            key = _key(mi, counts)
            if key is None or (key not in found and len(found) >= room) or outside >> mi.register(-1) & 1:
                kept.append(mi)
                continue
            r = mi.register(-1)
            if key in found:
                rename[r] = found[key]
            else:
                found[key] = r
                entry.insts.insert(len(entry.insts) - 1, mi)
        b.insts = kept
    if rename:
        for b in body:
            for mi in b.insts:
                mi.map_registers(rename)
