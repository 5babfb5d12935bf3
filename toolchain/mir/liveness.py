"""Live registers at block borders, by backward data flow. A set of registers is one int, bit n for register n."""

from __future__ import annotations

from toolchain.mir.mir import MI, MBlock, MFunction

SP_BIT = 1 << 15


def bits(registers: list[int]) -> int:
    """Set of the given registers."""
    out = 0
    for r in registers:
        out |= 1 << r
    return out


def members(mask: int) -> list[int]:
    """Registers in a set."""
    out = []
    while mask:
        low = mask & -mask
        out.append(low.bit_length() - 1)
        mask ^= low
    return out


def live_out(m: MFunction, at_return: int = 0) -> dict[str, int]:
    """Block name -> registers live at its end. `at_return` is live after ret (callee-saved ones, after allocation)."""
    gen: dict[str, int] = {}
    kill: dict[str, int] = {}
    for b in m.blocks:
        gen[b.name], kill[b.name] = summary(b)
    return solve(m, gen, kill, at_return)


def summary(b: MBlock) -> tuple[int, int]:
    """Registers a block reads before it writes them, and registers it writes."""
    g = k = 0
    for mi in reversed(b.insts):
        u, d = mi.register_sets()
        g = g & ~d | u
        k |= d
    return g, k


def solve(m: MFunction, gen: dict[str, int], kill: dict[str, int], at_return: int = 0) -> dict[str, int]:
    """`live_out` from the summaries of all blocks."""
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
    """Drop instructions whose results and flags nobody reads. Repeats until nothing changes."""
    gen: dict[str, int] = {}
    kill: dict[str, int] = {}
    for b in m.blocks:
        gen[b.name], kill[b.name] = summary(b)
    known: dict[str, int] = {}  # what was live behind a block when its dead code was dropped
    changed = True
    while changed:
        out = solve(m, gen, kill)
        changed = False
        for b in m.blocks:
            if known.get(b.name) == out[b.name]:
                continue
            known[b.name] = out[b.name]
            if drop_dead(b, out[b.name]):
                changed = True
                gen[b.name], kill[b.name] = summary(b)


def drop_dead(b: MBlock, live: int) -> bool:
    """The same in one block, `live` being the registers live at its end; flags never live across blocks.

    Once more with the same `live` it finds nothing.
    """
    kept: list[MI] = []
    flags: set[str] = set()
    for mi in reversed(b.insts):
        u, d = mi.register_sets()
        writes = mi.flags_written_set()
        if (d or writes) and not d & (live | SP_BIT) and not flags & writes and not mi.effect():
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
