"""Local common subexpression elimination: replaces a repeated computation in a block by the first one's register.

Addresses such as a[i] and b[i] share their scaled index only in the machine form. Needs: virtual registers. Both
registers have a single definition, so the first register contains the value at every use of the second.
"""

from __future__ import annotations

from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import FIRST_VIRTUAL, Imm
from toolchain.optimise.peephole import flags_unused

REACH = 12  # maximum number of instructions between the computations; longer live ranges cost registers
PURE = frozenset((
    "add", "sub", "subr", "and", "ior", "xor", "inc", "inc2", "dec", "dec2", "neg", "com", "sl", "lsr", "asr", "sl1",
    "lsr1", "asr1", "se", "ze", "rlnc", "rrnc",
))  # fmt: skip
Expression = tuple[object, ...]


def run(m: MFunction) -> None:
    """Rewrite every block, then rename the registers of the removed computations."""
    counts: dict[int, int] = {}
    for b in m.blocks:
        for mi in b.insts:
            for r in mi.defs():
                counts[r] = counts.get(r, 0) + 1
    rename: dict[int, int] = {}
    hinted = {*m.pair_hints, *m.pair_hints.values()}
    for b in m.blocks:
        _eliminate(b, counts, hinted, rename)
    if rename:
        for b in m.blocks:
            for mi in b.insts:
                mi.map_registers(rename)
        for record, (variable, words) in m.bindings.items():
            m.bindings[record] = (variable, tuple(rename.get(r, r) for r in words))


def _eliminate(b: MBlock, counts: dict[int, int], hinted: set[int], rename: dict[int, int]) -> None:
    known: dict[Expression, tuple[int, int]] = {}
    out: list[MI] = []
    for at, mi in enumerate(b.insts):
        if mi.op in ("call", "callr", "asm"):
            known.clear()
        mi.map_registers(rename)
        key = _key(mi, counts)
        dest = mi.args[-1] if mi.args else None
        if key is not None and isinstance(dest, int):
            found = known.get(key)
            if found is not None and at - found[1] <= REACH and dest not in hinted and flags_unused(b, at):
                rename[dest] = found[0]
                known[key] = (found[0], at)
                continue
        written = set(mi.defs())
        for old in [k for k in known if written & set(k[2:])]:
            del known[old]
        if key is not None and isinstance(dest, int):
            known[key] = (dest, at)
        out.append(mi)
    b.insts = out


def _key(mi: MI, counts: dict[int, int]) -> Expression | None:
    """Operation and operands of a computation with a single-definition result; None for other instructions."""
    if mi.op not in PURE or mi.pred:
        return None
    *sources, dest = mi.args
    if not isinstance(dest, int) or dest < FIRST_VIRTUAL or counts[dest] != 1:
        return None
    if not all(isinstance(a, Imm) or (isinstance(a, int) and a >= FIRST_VIRTUAL) for a in sources):
        return None
    return mi.op, mi.byte, *sources
