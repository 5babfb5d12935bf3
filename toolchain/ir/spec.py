"""Rules of well-formed functions. `check` returns all violations; tests call it after every pass."""

from __future__ import annotations

from .model import Arg, Block, Const, Function, InlineAsm, Instr, MetaRef, Value

TERMINATORS = frozenset(("ret", "br", "switch", "brtable", "indirectbr", "unreachable"))
LEGAL_WIDTHS = frozenset((1, 8, *range(16, 272, 16)))
NOT_LEGAL = frozenset((
    "getelementptr", "alloca", "fadd", "fsub", "fmul", "fdiv", "frem", "fneg", "fcmp", "fptosi", "fptoui",
    "sitofp", "uitofp",
    "fpext", "fptrunc", "extractvalue", "insertvalue", "freeze", "bitcast", "ptrtoint", "inttoptr", "va_arg",
    "atomicrmw",
    "cmpxchg", "fence",
))  # fmt: skip


def check(f: Function, legal: bool = False) -> list[str]:
    """Violations as sentences, empty if the function is well-formed; `legal` adds the rules of legal IR."""
    found: list[str] = []
    names = [b.name for b in f.blocks]
    if len(set(names)) != len(names):
        found.append("two blocks have one name")
    known = set(names)
    for b in f.blocks:
        found += _check_block(b, known)
    if not found:
        found += _check_values(f)
    if legal:
        found += _check_legal(f)
    return [f"{f.name}: {what}" for what in found]


def _check_block(b: Block, known: set[str]) -> list[str]:
    if not b.instrs or b.instrs[-1].op not in TERMINATORS:
        return [f"block {b.name} does not end in a terminator"]
    found = [f"{i!r} precedes the end of block {b.name}" for i in b.instrs[:-1] if i.op in TERMINATORS]
    body = False
    for i in b.instrs:
        if i.op == "phi" and body:
            found.append(f"phi {i!r} follows other instructions of block {b.name}")
        body |= i.op != "phi"
    return found + [f"block {b.name} branches to unknown {s}" for s in b.succs if s not in known]


def _check_values(f: Function) -> list[str]:
    """Check that operands are defined on every path to their uses, by forward data flow."""
    preds: dict[str, list[str]] = {b.name: [] for b in f.blocks}
    for b in f.blocks:
        for s in b.succs:
            preds[s].append(b.name)
    defined_in = {b.name: {id(i) for i in b.instrs} for b in f.blocks}
    everything = set().union(*defined_in.values())
    at_end = {b.name: set(everything) for b in f.blocks}
    at_end[f.blocks[0].name] = set(defined_in[f.blocks[0].name])
    changed = True
    while changed:
        changed = False
        for b in f.blocks[1:]:
            before = set.intersection(*(at_end[p] for p in preds[b.name])) if preds[b.name] else set()
            after = before | defined_in[b.name]
            if after != at_end[b.name]:
                at_end[b.name] = after
                changed = True
    found = []
    args = {id(a) for a in f.args}
    for b in f.blocks:
        have = set.intersection(*(at_end[p] for p in preds[b.name])) if preds[b.name] else set()
        have = set(have)
        for i in b.instrs:
            found += _check_operands(i, b, have, args, at_end, preds[b.name])
            have.add(id(i))
    return found


def _check_operands(
    i: Instr, b: Block, have: set[int], args: set[int], at_end: dict[str, set[int]], preds: list[str]
) -> list[str]:
    if i.op == "phi":
        found = (
            [] if sorted(i.blocks) == sorted(preds) else [f"phi {i!r} of block {b.name} does not name its predecessors"]
        )
        places = [at_end.get(n, set()) for n in i.blocks]
    else:
        found, places = [], [have] * len(i.args)
    for a, place in zip(i.args, places, strict=True):
        if not _available(a, place, args):
            found.append(f"{i!r} in block {b.name} uses {a!r} where it is not defined")
    return found


def _available(a: Value, place: set[int], args: set[int]) -> bool:
    if isinstance(a, Const | InlineAsm | MetaRef):
        return True
    return id(a) in args if isinstance(a, Arg) else id(a) in place


def _check_legal(f: Function) -> list[str]:
    found = []
    for b in f.blocks:
        for i in b.instrs:
            if i.op in NOT_LEGAL:
                found.append(f"{i.op} remains in block {b.name}")
            for v in [i, *i.args]:
                if v.type.kind in ("float", "struct", "array") or (
                    v.type.kind == "int" and v.type.bits not in LEGAL_WIDTHS
                ):
                    found.append(f"{i!r} in block {b.name} has an operand of type {v.type}")
    return found
