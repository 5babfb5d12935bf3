"""Spill code: registers without a colour are stored in frame slots or rematerialised at every use."""

from __future__ import annotations

from collections.abc import Set

from toolchain.mir.function import FrameObject, MFunction
from toolchain.mir.instruction import MI, covered_count
from toolchain.mir.operands import FrameSlot, Imm

REMATERIALISABLE = {"clr", "setm", "lea"}
UNIT_REGISTERS = 12  # maximum number of registers used under one skip; the others are live across the skip


def rewrite_spills(m: MFunction, groups: dict[int, list[int]]) -> None:
    """Spill groups of coalesced registers: each group gets one frame slot or is rematerialised."""
    slot_of: dict[int, int] = {}
    rematerialised: dict[int, MI] = {}
    definitions = _single_definitions(m, {r for g in groups.values() for r in g})
    for group in groups.values():
        source = definitions.get(group[0]) if len(group) == 1 else None
        if source is not None and _cheap(m, source):
            rematerialised[group[0]] = source
            continue
        m.frame.append(FrameObject(4 if group[0] in m.pairs else 2, None, True))
        for r in group:
            slot_of[r] = len(m.frame) - 1
    for b in m.blocks:
        insts = _narrow_skips(b.insts, slot_of.keys() | rematerialised.keys())
        b.insts = _rewrite_block(m, insts, slot_of, rematerialised)


def _single_definitions(m: MFunction, wanted: set[int]) -> dict[int, MI]:
    """The instruction that writes a register, for registers with exactly one unconditional definition."""
    found: dict[int, MI] = {}
    many: set[int] = set()
    for b in m.blocks:
        for mi in b.insts:
            for r in mi.defs():
                if r in wanted:
                    if r in found:
                        many.add(r)
                    found[r] = mi
    return {r: mi for r, mi in found.items() if r not in many and not mi.pred}


def _cheap(m: MFunction, mi: MI) -> bool:
    """Whether repeating the instruction costs no more than a load from the frame."""
    if mi.op in REMATERIALISABLE:
        return True
    if mi.op != "mov" or mi.byte:
        return False
    a = mi.args[0]
    if isinstance(a, FrameSlot):
        return not a.volatile and m.frame[a.index].fixed is not None and not _slot_written(m, a.index)
    return isinstance(a, Imm)


def _slot_written(m: MFunction, index: int) -> bool:
    for b in m.blocks:
        for mi in b.insts:
            for role, a in zip(mi.info.roles, mi.args, strict=False):
                if isinstance(a, FrameSlot) and a.index == index and (role in "db" or mi.op == "lea"):
                    return True
    return False


def _rewrite_block(m: MFunction, insts: list[MI], slot_of: dict[int, int], rematerialised: dict[int, MI]) -> list[MI]:
    """Insert loads before and stores after the instructions of a block; a skip and its instructions are one unit."""
    out: list[MI] = []
    chain = 0  # index in `out` of the last instruction that starts a chain of flag computations
    k = 0
    while k < len(insts):
        size = 1 + covered_count(insts, k)
        unit = insts[k : k + size]
        k += size
        before: list[MI] = []
        after: list[MI] = []
        renames: dict[int, int] = {}
        kept: list[MI] = []
        for mi in unit:
            if _is_rematerialised_definition(mi, rematerialised):
                continue
            direct = _direct_move(mi, slot_of, rematerialised) if size == 1 else None
            if direct is not None:
                kept.append(direct)
                continue
            _rewrite_one(m, mi, slot_of, rematerialised, renames, before, after)
            kept.append(mi)
        if any(mi.flags_read() for mi in unit) and any(mi.info.writes for mi in before):
            out[chain:chain] = before
        else:
            out += before
        if any(mi.info.writes and not mi.flags_read() and not mi.pred for mi in unit):
            chain = len(out)
        out += kept
        out += after
    return out


def _narrow_skips(insts: list[MI], spilled: Set[int]) -> list[MI]:
    """Split a skip into two if its covered instructions use too many registers; the flags are unchanged.

    Loads for covered instructions precede the skip and stores follow it, so all their registers are live at once."""
    out: list[MI] = []
    skip = None
    named: set[int] = set()
    for k, mi in enumerate(insts):
        if mi.op == "skip":
            unit = insts[k + 1 : k + 1 + covered_count(insts, k)]
            wide = any(r in spilled for one in unit for r in (*one.uses(), *one.defs()))
            skip, named = (mi if wide and not any(one.info.writes for one in unit) else None), set()
        elif mi.pred and skip is not None:
            registers = {*mi.uses(), *mi.defs()}
            if len(named | registers) > UNIT_REGISTERS:
                out.append(skip.clone())
                named = set()
            named |= registers
        out.append(mi)
    return out


def _is_rematerialised_definition(mi: MI, rematerialised: dict[int, MI]) -> bool:
    return any(mi is source for source in rematerialised.values())


def _direct_move(mi: MI, slot_of: dict[int, int], rematerialised: dict[int, MI]) -> MI | None:
    """The load or store that replaces a copy from or to a spilled register; None if it needs another register."""
    if not mi.is_copy() or mi.args[0] in rematerialised:
        return None
    source, dest = mi.register(0), mi.register(1)
    if source in slot_of and dest not in slot_of:
        return MI("mov", FrameSlot(slot_of[source]), dest, line=mi.line)
    if dest in slot_of and source not in slot_of:
        return MI("mov", source, FrameSlot(slot_of[dest]), line=mi.line)
    return None


def _rewrite_one(
    m: MFunction,
    mi: MI,
    slot_of: dict[int, int],
    rematerialised: dict[int, MI],
    renames: dict[int, int],
    before: list[MI],
    after: list[MI],
) -> None:
    uses, defs = set(mi.uses()), set(mi.defs())
    for r in uses | defs:
        if r not in slot_of and r not in rematerialised:
            continue
        t = renames.get(r)
        if t is None:
            t = renames[r] = m.new_pair() if r in m.pairs else m.new_register()
            m.temps.add(t)
            if r in rematerialised:
                source = rematerialised[r]
                before.append(MI(source.op, *[t if a == r else a for a in source.args], line=mi.line))
            elif r in uses:
                before += _transfer(m, r, slot_of[r], t, True, mi.line)
        if r in defs and r in slot_of:
            after += _transfer(m, r, slot_of[r], t, False, mi.line)
    mi.map_registers(renames)


def _transfer(m: MFunction, r: int, slot: int, t: int, load: bool, line: str | None) -> list[MI]:
    """Load or store of one register; pairs are transferred word by word."""
    if r not in m.pairs:
        return [MI("mov", FrameSlot(slot), t, line=line) if load else MI("mov", t, FrameSlot(slot), line=line)]
    low, high = m.new_register(), m.new_register()
    m.temps |= {low, high}
    if load:
        return [
            MI("mov", FrameSlot(slot), low, line=line),
            MI("mov", FrameSlot(slot, 2), high, line=line),
            MI("join", t, low, high, line=line),
        ]
    return [
        MI("split", low, high, t, line=line),
        MI("mov", low, FrameSlot(slot), line=line),
        MI("mov", high, FrameSlot(slot, 2), line=line),
    ]
