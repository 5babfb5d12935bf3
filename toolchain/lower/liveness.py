"""Live registers at block borders, by backward data flow. A set of registers is one int, bit n for register n."""

from __future__ import annotations

from .mir import MI, SIDE_EFFECTS, Mem, MFunction, Slot

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
        g = k = 0
        for mi in reversed(b.insts):
            d, u = bits(mi.defs()), bits(mi.uses())
            g = g & ~d | u
            k |= d
        gen[b.name], kill[b.name] = g, k
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


def has_effect(mi: MI) -> bool:
    """Whether an instruction does more than write registers and flags."""
    if mi.op in SIDE_EFFECTS or mi.volatile or (mi.op.endswith("f") and mi.op not in ("cpf",)):
        return True
    for role, a in zip(mi.info.roles, mi.args, strict=False):
        if a.__class__ is Mem:
            if role in "db" or a.mode in ("++", "--", "+", "-"):
                return True
        elif (role == "d" and a.__class__ is not int) or (role == "b" and a.__class__ is Slot):
            return True
    return False


def remove_dead(m: MFunction) -> None:
    """Drop instructions whose results and flags nobody reads. Repeats until nothing changes."""
    changed = True
    while changed:
        changed = False
        out = live_out(m)
        for b in m.blocks:
            live = out[b.name]
            flags_live = False
            kept: list[MI] = []
            guarded = 0
            for mi in reversed(b.insts):
                d = bits(mi.defs())
                dead = not d & (live | SP_BIT) and not has_effect(mi)
                if dead and mi.info.writes and flags_live:
                    dead = False
                if dead and (d or mi.info.writes):
                    changed = True
                    guarded += mi.pred
                    continue
                if mi.op == "skip":
                    mi.count -= guarded
                    guarded = 0
                    if mi.count == 0:
                        changed = True
                        continue
                if mi.flags_read():
                    flags_live = True
                if mi.info.writes and not mi.info.reads and not mi.pred:
                    flags_live = mi.op in ("skip", "bra")
                live = live & ~d | bits(mi.uses())
                kept.append(mi)
            kept.reverse()
            b.insts = kept
