"""Liveness analysis: live registers at block boundaries. A set of registers is an int, bit n for register n."""

from __future__ import annotations

from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI

SP_BIT = 1 << 15


def mask_of(registers: list[int]) -> int:
    """The set of the given registers."""
    out = 0
    for r in registers:
        out |= 1 << r
    return out


def registers_in(mask: int) -> list[int]:
    """The registers in a set, in ascending order."""
    out = []
    while mask:
        low = mask & -mask
        out.append(low.bit_length() - 1)
        mask ^= low
    return out


def live_out(m: MFunction, at_return: int = 0) -> dict[str, int]:
    """Registers live at the end of each block. `at_return`: registers live after RETURN (callee-saved registers)."""
    gen: dict[str, int] = {}
    kill: dict[str, int] = {}
    for b in m.blocks:
        gen[b.name], kill[b.name] = summary(b)
    return solve(m, gen, kill, at_return)


def summary(b: MBlock) -> tuple[int, int]:
    """Registers that a block reads before it writes them, and registers that it writes."""
    g = k = 0
    for mi in reversed(b.insts):
        u, d = mi.register_sets()
        g = g & ~d | u
        k |= d
    return g, k


def solve(m: MFunction, gen: dict[str, int], kill: dict[str, int], at_return: int = 0) -> dict[str, int]:
    """`live_out` computed from the summaries of all blocks, by backward data flow."""
    live_in: dict[str, int] = dict.fromkeys(gen, 0)
    out: dict[str, int] = dict.fromkeys(gen, 0)
    preds: dict[str, list[str]] = {b.name: [] for b in m.blocks}
    for b in m.blocks:
        for s in b.succs:
            preds[s].append(b.name)
    succs = {b.name: b.succs for b in m.blocks}
    work = [b.name for b in m.blocks]
    queued = set(work)
    while work:
        name = work.pop()
        queued.discard(name)
        o = 0 if succs[name] else at_return
        for s in succs[name]:
            o |= live_in[s]
        out[name] = o
        i = gen[name] | o & ~kill[name]
        if i != live_in[name]:
            live_in[name] = i
            for p in preds[name]:
                if p not in queued:
                    queued.add(p)
                    work.append(p)
    return out


def remove_dead(m: MFunction) -> None:
    """Remove instructions whose results and flags are not read, until nothing changes."""
    gen: dict[str, int] = {}
    kill: dict[str, int] = {}
    for b in m.blocks:
        gen[b.name], kill[b.name] = summary(b)
    known: dict[str, int] = {}  # registers that were live after a block when its dead code was removed
    changed = True
    while changed:
        out = solve(m, gen, kill)
        changed = False
        for b in m.blocks:
            if known.get(b.name) == out[b.name]:
                continue
            known[b.name] = out[b.name]
            if remove_dead_in_block(b, out[b.name]):
                changed = True
                gen[b.name], kill[b.name] = summary(b)


def remove_dead_in_block(b: MBlock, live: int) -> bool:
    """Remove dead code from one block and return whether there was any; `live` are the registers live at its end.

    Flags are never live across blocks. A second call with the same `live` removes nothing.
    """
    kept: list[MI] = []
    flags: set[str] = set()
    for mi in reversed(b.insts):
        u, d = mi.register_sets()
        writes = mi.flags_written_set()
        if (d or writes) and not d & (live | SP_BIT) and not flags & writes and not mi.has_effect():
            continue
        if mi.op == "skip" and not (kept and kept[-1].pred):
            continue
        if not mi.pred:
            flags -= writes
        flags.update(mi.flags_read())
        live = live & ~d | u
        kept.append(mi)
    kept.reverse()
    changed = len(kept) != len(b.insts)
    b.insts = kept
    return changed
