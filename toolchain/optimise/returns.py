"""Returns: RETURN instead of a branch to RETURN, and RETLW for constant results.

RETLW #lit10, W0 returns and loads the result (isa.md §5.7). It takes one word less than MOV and RETURN, and three
cycles like RETURN. Needs: the final order of blocks.
"""

from __future__ import annotations

import copy

from toolchain.abi.target import LIT10_MAX
from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import Imm
from toolchain.optimise.branches import remove_unreached

RESULT = 0  # W0, the result register


def run(m: MFunction) -> None:
    """Replace branches to RETURN by RETURN, then loads of constant results by RETLW."""
    _return_early(m)
    if not m.interrupt:
        for b in list(m.blocks):
            _return_either(m, b)
            _load_while_returning(b)


def _return_early(m: MFunction) -> None:
    """Replace a branch to a block that only returns by RETURN, which has the same size."""
    bare = {b.name: b.insts[0] for b in m.blocks if len(b.insts) == 1 and b.insts[0].op == "ret"}
    for b in m.blocks:
        if b.insts and b.insts[-1].op == "jump" and str(b.insts[-1].args[0]) in bare:
            target = str(b.insts[-1].args[0])
            b.insts[-1] = copy.copy(bare[target])
            if not any(mi.op == "bra" and mi.args[0] == target for mi in b.insts):
                b.succs = [s for s in b.succs if s != target]
    remove_unreached(m)


def _return_either(m: MFunction, b: MBlock) -> None:
    """Replace MOV #k,W0; skip; MOV #j,W0; RETURN by a branch to RETLW #k,W0 and RETLW #j,W0."""
    if len(b.insts) < 4 or b.insts[-1].op != "ret" or b.insts[-1].text:
        return
    first, skip, second, end = b.insts[-4:]
    if skip.op != "skip" or first.pred or not second.pred:
        return
    second = second.clone()
    second.pred = False
    values = _constant(first), _constant(second)
    if None in values:
        return
    other = MBlock(f"{b.name}.either", [end.clone()], [], b.depth)
    for ret, value in ((other.insts[0], values[0]), (end, values[1])):
        assert value is not None
        _load(ret, value)
    b.insts[-4:] = [MI("bra", other.name, cc=skip.cc, line=skip.line), end]
    b.succs = [other.name]
    m.blocks.append(other)


def _load(ret: MI, value: int) -> None:
    """Turn RETURN into RETLW."""
    ret.text = f"retlw #{value},w{RESULT}"
    ret.also_uses = tuple(r for r in ret.also_uses if r != RESULT)


def _load_while_returning(b: MBlock) -> None:
    """Replace MOV #k,W0; epilogue; RETURN by epilogue; RETLW #k,W0."""
    if not b.insts or b.insts[-1].op != "ret" or b.insts[-1].text:
        return
    for k in range(len(b.insts) - 2, -1, -1):
        mi = b.insts[k]
        value = _constant(mi)
        if value is not None:
            _load(b.insts[-1], value)
            del b.insts[k]
            return
        if RESULT in mi.defs() or RESULT in mi.uses() or mi.pred or mi.op in ("call", "callr", "asm", "text", "bra"):
            return


def _constant(mi: MI) -> int | None:
    """Constant that an instruction loads into the result register, if RETLW can load it; else None."""
    if mi.pred or mi.byte or not mi.args or mi.args[-1] != RESULT:
        return None
    if mi.op == "clr":
        return 0
    source = mi.args[0]
    if mi.op == "mov" and isinstance(source, Imm) and isinstance(source.value, int) and 0 <= source.value <= LIT10_MAX:
        return source.value
    return None
