"""Copies and constants in registers: loads of what a register holds already go, copies give way to their originals.

Facts travel along all edges of the function (what holds at a block's start holds at the end of every predecessor).
Needs: real registers, frames built. The caller drops what became dead, with liveness computed anew.
"""

from __future__ import annotations

from toolchain.abi.target import SP
from toolchain.mir.mir import MI, File, Imm, MBlock, Mem, MFunction

Known = tuple[str, object]
Facts = dict[int, int | Known]
"""Register -> the register it is a copy of, or the constant it holds."""
Effect = tuple[int, int, Known | None, int]
"""Registers an instruction writes, the one it copies (-1: none), the constant it loads, and the one for either (-1)."""


def run(m: MFunction) -> bool:
    """Rewrite every block; whether anything changed."""
    starts = _solve(m)
    changed = False
    for b in m.blocks:
        changed |= _rewrite(b, dict(starts[b.name]))
    return changed


def _solve(m: MFunction) -> dict[str, Facts]:
    """Facts at the start of every block. Blocks not reached yet know everything, so loops keep what they preserve."""
    entry = m.blocks[0].name
    starts: dict[str, Facts] = {entry: {}}
    starts |= {b.name: {} for b in m.blocks if b.address_taken}
    blocks = m.block_map()
    effects = {b.name: [_effect(mi) for mi in b.insts] for b in m.blocks}
    work = list(starts)
    while work:
        name = work.pop()
        facts = dict(starts[name])
        for effect in effects[name]:
            _follow(effect, facts)
        for s in dict.fromkeys(blocks[name].succs):
            old = starts.get(s)
            new = facts if old is None else {r: v for r, v in old.items() if facts.get(r) == v}
            if old is None or len(new) != len(old):
                starts[s] = dict(new)
                work.append(s)
    return {b.name: starts.get(b.name, {}) for b in m.blocks}


def _effect(mi: MI) -> Effect:
    """What one instruction does to facts."""
    copied = mi.args[0] if mi.is_copy() else None
    source = copied if isinstance(copied, int) and copied < SP else -1
    dest = mi.args[-1] if mi.args else None
    return mi.register_sets()[1], source, _constant(mi), dest if isinstance(dest, int) and dest < SP else -1


def _follow(effect: Effect, facts: Facts) -> None:
    """Facts after one instruction."""
    written, source, value, dest = effect
    result: int | Known | None = value if source < 0 else facts.get(source, source)
    if facts:
        _forget(written, facts)
    if dest >= 0 and result is not None and result != dest:
        facts[dest] = result


def _forget(written: int, facts: Facts) -> None:
    moved = written >> SP & 1  # addresses in the frame are relative to it
    gone = [
        r for r, v in facts.items()
        if written >> r & 1 or (written >> v & 1 if isinstance(v, int) else moved and v[0] != "k")
    ]  # fmt: skip
    for r in gone:
        del facts[r]


def _constant(mi: MI) -> Known | None:
    """What a load of a constant, or of an address in the frame, puts into its register."""
    if mi.pred or mi.byte or not mi.args or not isinstance(mi.args[-1], int):
        return None
    if mi.op == "clr":
        return "k", 0
    if mi.op == "setm":
        return "k", 0xFFFF
    if mi.op == "mov" and isinstance(mi.args[0], Imm):
        return "k", mi.args[0].value
    if mi.op in ("add", "sub") and mi.args[0] == SP and isinstance(mi.args[1], Imm):
        return f"sp {mi.op}", mi.args[1].value
    return None


def _rewrite(b: MBlock, facts: Facts) -> bool:
    out: list[MI] = []
    made: Facts = {}  # in this block: longer lives of originals would cost more than they give
    changed = False
    for mi in b.insts:
        if _restates(mi, facts):
            changed = True
            continue
        changed |= _use_originals(mi, made)
        effect = _effect(mi)
        _follow(effect, facts)
        _follow(effect, made)
        out.append(mi)
    b.insts = out
    return changed


def _restates(mi: MI, facts: Facts) -> bool:
    """Whether the register it writes holds that value already."""
    dest = mi.args[-1] if mi.args else None
    if not isinstance(dest, int) or dest >= SP:
        return False
    if mi.is_copy():
        source = mi.args[0]
        assert isinstance(source, int)
        return facts.get(dest, dest) == facts.get(source, source)
    known = _constant(mi)
    return known is not None and facts.get(dest) == known


def _use_originals(mi: MI, facts: Facts) -> bool:
    """Replace read-only register operands by what they are copies of."""
    if not facts or mi.pred or mi.op in ("asm", "split", "join", "movd"):
        return False
    if mi.byte and any(isinstance(a, File) for a in mi.args):
        return False  # near bytes move through W0 only (isa.md §3.3)
    changed = False
    for k, (role, a) in enumerate(zip(mi.info.roles, mi.args, strict=False)):
        if role != "s":
            continue
        if isinstance(a, int):
            original = facts.get(a)
            if isinstance(original, int) and k not in mi.late and not mi.op.endswith("f"):
                mi.args[k] = original
                changed = True
        elif isinstance(a, Mem) and a.mode in ("ind", "off"):
            original = facts.get(a.base)
            if isinstance(original, int):
                mi.args[k] = Mem(a.mode, original, a.off, a.volatile)
                changed = True
    return changed
