"""Instruction scheduling: fill read-after-write stalls.

An instruction that uses Wn as a source address stalls for a cycle directly after one that writes Wn (isa.md §13.2). The
pass moves an independent instruction between the two. Needs: final instructions of each block. The size is unchanged.
"""

from __future__ import annotations

from toolchain.abi.target import SP
from toolchain.mir.function import MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.liveness import mask_of
from toolchain.mir.operands import STEPPING, Mem
from toolchain.mir.operations import SKIPS

WINDOW = 4


def run(m: MFunction) -> None:
    """Fill the stalls of every block, from its start to its end."""
    for b in m.blocks:
        k = 0
        while k + 1 < len(b.insts):
            if stalls(b.insts[k], b.insts[k + 1]) and not _fill_from_below(b.insts, k):
                _fill_from_above(b.insts, k)
            k += 1


def stalls(first: MI, second: MI) -> bool:
    """Whether `second` stalls for a register that `first` writes."""
    written = mask_of(_destination_writes(first))
    return bool(written & mask_of(_source_addresses(second)))


def _destination_writes(mi: MI) -> list[int]:
    """Registers written as destination, or modified as destination pointer; modified source pointers do not stall."""
    out = list(mi.also_defs) if mi.op not in ("call", "callr") else []
    for role, a in zip(mi.info.roles, mi.args, strict=False):
        if isinstance(a, int):
            if role in "dbD":
                out += [a, a + 1] if role == "D" else [a]
        elif isinstance(a, Mem) and role == "d" and a.mode in STEPPING:
            out.append(a.base)
    return out


def _source_addresses(mi: MI) -> list[int]:
    """Registers that an instruction uses as source addresses."""
    out = []
    for role, a in zip(mi.info.roles, mi.args, strict=False):
        if isinstance(a, Mem) and role in "sbS":
            out.append(a.base)
            if a.mode == "idx":
                out.append(a.off)
    return out


def _movable(mi: MI) -> bool:
    """Whether an instruction may be moved: no effects, not covered by a skip, no use of the stack pointer."""
    if mi.pred or mi.has_effect() or mi.also_defs or mi.also_uses:
        return False
    return all(a != SP and not (isinstance(a, Mem) and a.base == SP) for a in mi.args)


def _independent(a: MI, b: MI) -> bool:
    """Whether two adjacent instructions may be exchanged."""
    if a.info.fixed or b.info.fixed:
        return False
    if (a.writes_memory() and (b.reads_memory() or b.writes_memory())) or (b.writes_memory() and a.reads_memory()):
        return False
    da, db = mask_of(a.defs()), mask_of(b.defs())
    if da & db or da & mask_of(b.uses()) or db & mask_of(a.uses()):
        return False
    wa, wb = set(a.flags_written()), set(b.flags_written())
    return not (wa & wb or wa & set(b.flags_read()) or wb & set(a.flags_read()))


def _fill_from_below(insts: list[MI], k: int) -> bool:
    """Move a later instruction up between insts[k] and insts[k+1]; return whether there was one."""
    for j in range(k + 2, min(k + 2 + WINDOW, len(insts))):
        mover = insts[j]
        if insts[j - 1].op in SKIPS or insts[j - 1].pred or mover.info.fixed:
            return False
        free = _movable(mover) and all(_independent(mover, x) for x in insts[k + 1 : j])
        if free and not stalls(insts[k], mover) and not _flags_reach_end(insts, j, mover):
            insts.insert(k + 1, insts.pop(j))
            return True
    return False


def _flags_reach_end(insts: list[MI], j: int, mover: MI) -> bool:
    """Whether an instruction after position j reads flags that the moved instruction writes."""
    live = set(mover.flags_written())
    for mi in insts[j + 1 :]:
        if live & set(mi.flags_read()) or mi.op in ("asm", "text"):
            return True
        if not mi.pred:
            live -= set(mi.flags_written())
    return False


def _fill_from_above(insts: list[MI], k: int) -> None:
    """Move insts[k-1] down after insts[k] if they are independent and no new stall results."""
    if k == 0 or insts[k - 1].op in SKIPS or insts[k].pred or insts[k + 1].pred:
        return
    mover = insts[k - 1]
    if k >= 2 and (insts[k - 2].op in SKIPS or insts[k - 2].pred or stalls(insts[k - 2], insts[k])):
        return
    free = _movable(mover) and not mover.flags_written() and _independent(mover, insts[k])
    if free and not stalls(mover, insts[k + 1]):
        insts[k - 1], insts[k] = insts[k], insts[k - 1]
