"""Copy and constant propagation: removes redundant loads of registers, and replaces copies by their originals.

Forward data flow over the whole function: a fact holds at the start of a block if it holds at the end of every
predecessor. Needs: real registers, frames built. The caller removes dead code with a new liveness analysis.
"""

from __future__ import annotations

from toolchain.abi.target import SP
from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import FileRegister, Imm, Mem

KnownConstant = tuple[str, object]
RegisterFacts = dict[int, int | KnownConstant]
"""By register: the register of which it is a copy, or the constant that it contains."""
Transfer = tuple[int, int, KnownConstant | None, int]
"""Mask of written registers; source of a copy (-1: none), loaded constant, and destination of either (-1: none)."""


def run(m: MFunction) -> bool:
    """Rewrite every block and return whether anything changed."""
    starts = _solve(m)
    changed = False
    for b in m.blocks:
        changed |= _rewrite(b, dict(starts[b.name]))
    return changed


def _solve(m: MFunction) -> dict[str, RegisterFacts]:
    """Facts at the start of every block. Optimistic: unvisited predecessors of a loop do not remove facts."""
    entry = m.blocks[0].name
    starts: dict[str, RegisterFacts] = {entry: {}}
    starts |= {b.name: {} for b in m.blocks if b.address_taken}
    blocks = m.block_map()
    transfers = {b.name: [_transfer(mi) for mi in b.insts] for b in m.blocks}
    work = list(starts)
    while work:
        name = work.pop()
        facts = dict(starts[name])
        for transfer in transfers[name]:
            _apply_transfer(transfer, facts)
        for s in dict.fromkeys(blocks[name].succs):
            old = starts.get(s)
            new = facts if old is None else {r: v for r, v in old.items() if facts.get(r) == v}
            if old is None or len(new) != len(old):
                starts[s] = dict(new)
                work.append(s)
    return {b.name: starts.get(b.name, {}) for b in m.blocks}


def _transfer(mi: MI) -> Transfer:
    """Effect of one instruction on the facts."""
    copied = mi.args[0] if mi.is_copy() else None
    source = copied if isinstance(copied, int) and copied < SP else -1
    dest = mi.args[-1] if mi.args else None
    return mi.register_sets()[1], source, _constant(mi), dest if isinstance(dest, int) and dest < SP else -1


def _apply_transfer(transfer: Transfer, facts: RegisterFacts) -> None:
    """Update the facts by one instruction."""
    written, source, value, dest = transfer
    result: int | KnownConstant | None = value if source < 0 else facts.get(source, source)
    if facts:
        _forget(written, facts)
    if dest >= 0 and result is not None and result != dest:
        facts[dest] = result


def _forget(written: int, facts: RegisterFacts) -> None:
    """Remove the facts about registers that are written."""
    moved = written >> SP & 1  # whether W15 changes, to which frame addresses are relative
    gone = [
        r for r, v in facts.items()
        if written >> r & 1 or (written >> v & 1 if isinstance(v, int) else moved and v[0] != "k")
    ]  # fmt: skip
    for r in gone:
        del facts[r]


def _constant(mi: MI) -> KnownConstant | None:
    """Constant or frame address that an instruction loads into its register; None for other instructions."""
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


def _rewrite(b: MBlock, facts: RegisterFacts) -> bool:
    """Rewrite one block with the facts at its start; return whether it changed."""
    out: list[MI] = []
    made: RegisterFacts = {}  # facts of this block only: longer live ranges of originals cost more than they save
    changed = False
    for mi in b.insts:
        if _is_redundant(mi, facts):
            changed = True
            continue
        changed |= _use_originals(mi, made)
        transfer = _transfer(mi)
        _apply_transfer(transfer, facts)
        _apply_transfer(transfer, made)
        out.append(mi)
    b.insts = out
    return changed


def _is_redundant(mi: MI, facts: RegisterFacts) -> bool:
    """Whether the destination of a copy or load already contains its value."""
    dest = mi.args[-1] if mi.args else None
    if not isinstance(dest, int) or dest >= SP:
        return False
    if mi.is_copy():
        source = mi.register(0)
        return facts.get(dest, dest) == facts.get(source, source)
    known = _constant(mi)
    return known is not None and facts.get(dest) == known


def _use_originals(mi: MI, facts: RegisterFacts) -> bool:
    """Replace copies in read-only operands by their originals; return whether there were any."""
    if not facts or mi.pred or mi.op in ("asm", "split", "join", "movd"):
        return False
    if mi.byte and any(isinstance(a, FileRegister) for a in mi.args):
        return False  # byte moves of near memory use W0 only (isa.md §3.3)
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
