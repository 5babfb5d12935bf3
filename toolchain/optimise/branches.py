"""Branch optimisation: jump threading, fall-through, skip instructions, tail calls."""

from __future__ import annotations

import copy

from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI, covered_count
from toolchain.mir.liveness import live_out, mask_of, summary
from toolchain.mir.operands import FileRegister, Imm, Mem
from toolchain.mir.operations import CC_INVERSE
from toolchain.optimise import block_layout
from toolchain.optimise.peephole import ALL, AT_RETURN


def reorder(m: MFunction) -> None:
    """Bypass branches with a known outcome, empty blocks on edges, and order blocks. Needs: explicit branches."""
    thread_constants(m)
    hoist_edge_moves(m)
    thread_jumps(m)
    block_layout.run(m)


def run(m: MFunction) -> None:
    """Remove redundant branches and use skip instructions. Needs: the final order of blocks, explicit branches."""
    fall_through(m)
    thread_jumps(m)
    for b in m.blocks:
        use_skips(b)


def thread_jumps(m: MFunction) -> None:
    """Redirect branches to blocks that only jump to their final targets; remove unreachable blocks."""
    forward: dict[str, str] = {}
    for b, following in zip(m.blocks, [*m.blocks[1:], None], strict=True):
        if b.address_taken:
            continue
        if len(b.insts) == 1 and b.insts[0].op == "jump":
            forward[b.name] = str(b.insts[0].args[0])
        elif not b.insts and following is not None:
            forward[b.name] = following.name

    def final(name: str) -> str:
        seen = set()
        while name in forward and name not in seen:
            seen.add(name)
            name = forward[name]
        return name

    for b in m.blocks:
        for mi in b.insts:
            if mi.op in ("bra", "jump"):
                mi.args[0] = final(mi.target)
        b.succs = list(dict.fromkeys(final(s) for s in b.succs))
    m.tables = [(name, [final(t) for t in targets]) for name, targets in m.tables]
    remove_unreached(m)


def remove_unreached(m: MFunction) -> None:
    """Remove blocks that cannot be reached from the entry or by a block address."""
    blocks = m.block_map()
    work = [m.blocks[0].name, *(b.name for b in m.blocks if b.address_taken)]
    reached = set(work)
    while work:
        for s in blocks[work.pop()].succs:
            if s not in reached:
                reached.add(s)
                work.append(s)
    m.blocks = [b for b in m.blocks if b.name in reached]


def fall_through(m: MFunction) -> None:
    """Remove branches to the following block; invert a conditional branch over a jump."""
    depth = {b.name: b.depth for b in m.blocks}
    for k, b in enumerate(m.blocks):
        following = m.blocks[k + 1].name if k + 1 < len(m.blocks) else ""
        if len(b.insts) >= 2 and b.insts[-1].op == "jump" and b.insts[-2].op == "bra":
            bra, jump = b.insts[-2], b.insts[-1]
            if bra.args[0] == jump.args[0]:
                b.insts.remove(bra)
            elif bra.args[0] == following:
                b.insts[-2:] = [MI("bra", jump.args[0], cc=CC_INVERSE[bra.cc], line=bra.line)]
                continue
            elif jump.args[0] != following and depth[str(jump.args[0])] > depth[str(bra.args[0])]:
                bra.cc = CC_INVERSE[bra.cc]
                bra.args, jump.args = jump.args, bra.args
        if b.insts and b.insts[-1].op == "jump" and b.insts[-1].args[0] == following:
            b.insts.pop()


NEUTRAL = {"clr", "clrd", "setm", "mov"}


def hoist_edge_moves(m: MFunction) -> None:
    """Hoist register moves from one edge of a conditional branch above the branch, if the other edge is not affected.

    The block on the edge then contains only a jump, so the branch is redirected to its target. Moves change no flags.
    """
    blocks = m.block_map()
    out = live_out(m, ALL if m.interrupt else AT_RETURN)
    preds: dict[str, int] = {}
    for b in m.blocks:
        for s in b.succs:
            preds[s] = preds.get(s, 0) + 1
    for b in m.blocks:
        if len(b.insts) < 2 or b.insts[-1].op != "jump" or b.insts[-2].op != "bra":
            continue
        bra, jump = b.insts[-2], b.insts[-1]
        for target, other in ((str(bra.args[0]), str(jump.args[0])), (str(jump.args[0]), str(bra.args[0]))):
            edge = blocks[target]
            if preds[target] != 1 or edge.address_taken or target == other or len(edge.insts) < 2:
                continue
            moves = edge.insts[:-1]
            if edge.insts[-1].op != "jump" or len(moves) > MAX_HOISTED or not all(_is_neutral(mi) for mi in moves):
                continue
            if mask_of([r for mi in moves for r in mi.defs()]) & live_in(blocks[other], out[other]):
                continue
            b.insts[-2:-2] = moves
            edge.insts = edge.insts[-1:]
            break


MAX_HOISTED = 3


def _is_neutral(mi: MI) -> bool:
    """Whether an instruction is a register move or constant load, which changes neither flags nor memory."""
    return mi.op in NEUTRAL and not mi.byte and not mi.pred and all(isinstance(a, int | Imm) for a in mi.args)


def live_in(block: MBlock, live: int) -> int:
    """Registers live at the start of a block, computed from those live at its end.

    Hoisting changes the live registers of the emptied block only, so the pass needs only one liveness analysis."""
    reads, kill = summary(block)
    return reads | live & ~kill


def thread_constants(m: MFunction) -> None:
    """Bypass a block that only compares a register with a constant, if the jumping block leaves a constant in it."""
    blocks = m.block_map()
    for b in m.blocks:
        if not b.insts or b.insts[-1].op != "jump":
            continue
        target = blocks[str(b.insts[-1].args[0])]
        if len(target.insts) != 3 or target.insts[1].op != "bra" or target.insts[2].op != "jump":
            continue
        taken = _decide(b, target.insts[0], target.insts[1].cc)
        if taken is None:
            continue
        goal = str(target.insts[1].args[0] if taken else target.insts[2].args[0])
        b.insts[-1] = MI("jump", goal, line=b.insts[-1].line)
        b.succs = list(dict.fromkeys(mi.target for mi in b.insts if mi.op in ("bra", "jump")))


def _decide(b: MBlock, test: MI, cc: str) -> bool | None:
    """Outcome of `test; bra cc` with the constants that the block leaves in registers; None if it is unknown."""
    if test.op not in ("cp", "cp0") or not isinstance(test.args[0], int):
        return None
    right = test.args[1] if test.op == "cp" else Imm(0)
    if not isinstance(right, Imm) or not isinstance(right.value, int):
        return None
    value = _known_value(b, test.args[0])
    if value is None:
        return None
    mask = 0xFF if test.byte else 0xFFFF
    return _evaluate(cc, value & mask, right.value & mask, mask)


def _known_value(b: MBlock, r: int) -> int | None:
    """Constant that the block leaves in register r; None if it is unknown."""
    for mi in reversed(b.insts):
        if r in mi.defs():
            if mi.pred or mi.byte:
                return None
            if mi.op in ("clr", "clrd"):
                return 0
            if mi.op == "setm":
                return 0xFFFF
            k = mi.args[0]
            return k.value if mi.op == "mov" and isinstance(k, Imm) and isinstance(k.value, int) else None
    return None


def _evaluate(cc: str, a: int, b: int, mask: int) -> bool | None:
    """Value of a condition after CP a, b; None for conditions not handled here."""
    sign = (mask >> 1) + 1
    x, y = a - 2 * (a & sign), b - 2 * (b & sign)
    answers = {"z": a == b, "nz": a != b, "c": a >= b, "nc": a < b, "gtu": a > b, "leu": a <= b, "lt": x < y,
               "ge": x >= y,
               "gt": x > y, "le": x <= y}  # fmt: skip
    return answers.get(cc)


# ---------------------------------------------------------------------------------------------------------------------
# skips

SKIP_WHEN = {"z": "cpseq", "nz": "cpsne", "lt": "cpslt", "gt": "cpsgt"}
TWO_WORDS = {"call", "tailcall", "jumpr", "repmov", "repclr", "repfill", "div.s", "div.u", "div.sd", "div.ud",
             "asm", "text",
             "shiftloop", "brtable", "lea"}  # fmt: skip


def use_skips(b: MBlock) -> None:
    """Replace a comparison and a skip over one instruction by CPSxx or BTSx (isa.md §7.3)."""
    k = 1
    while k < len(b.insts):
        skip = b.insts[k]
        if skip.op == "skip" and covered_count(b.insts, k) == 1 and b.insts[k + 1].op not in TWO_WORDS:
            short = _short_skip(b.insts[k - 1], skip)
            if short is not None and not _flags_needed(b, k):
                b.insts[k - 1 : k + 1] = [short]
                continue
        k += 1


def _short_skip(test: MI, skip: MI) -> MI | None:
    """The skip instruction with the effect of `test` and `skip`; None if there is none."""
    if test.op == "cp" and skip.cc in SKIP_WHEN and all(isinstance(a, int) for a in test.args):
        return MI(SKIP_WHEN[skip.cc], *test.args, byte=test.byte, line=skip.line)
    if test.op in ("btst", "btstf") and skip.cc in ("z", "nz"):
        operand = test.args[0]
        if isinstance(operand, int | FileRegister) or (isinstance(operand, Mem) and operand.mode == "ind"):
            name = ("btsc" if skip.cc == "z" else "btss") + test.op.removeprefix("btst")
            return MI(name, *test.args, byte=test.byte, line=skip.line)
    return None


def _flags_needed(b: MBlock, skip_at: int) -> bool:
    """Whether flags of the comparison are read after the covered instruction."""
    for mi in b.insts[skip_at + 1 :]:
        if mi.flags_read():
            return True
        if mi.info.writes and not mi.pred:
            return False
    return False


# ---------------------------------------------------------------------------------------------------------------------
# tail calls


def tail_calls(m: MFunction) -> None:
    """Replace CALL, epilogue, RETURN by epilogue, BRA: the callee returns to this function's caller.

    `MI.tail` or an empty frame make that correct. A branch to a block that only returns counts as RETURN.
    """
    if m.interrupt:
        return
    bare = {b.name: b.insts[0] for b in m.blocks if len(b.insts) == 1 and b.insts[0].op == "ret"}
    for b in m.blocks:
        if len(b.insts) > 1 and b.insts[-1].op == "jump" and b.insts[-2].op == "call":
            end = str(b.insts[-1].args[0])
            if end in bare:
                b.insts[-1] = copy.copy(bare[end])
                b.succs = []
        if not b.insts or b.insts[-1].op != "ret" or b.insts[-1].text:
            continue
        at = len(b.insts) - 2
        while at >= 0 and _is_epilogue(b.insts[at]):
            at -= 1
        if (
            at < 0
            or b.insts[at].op != "call"
            or not (b.insts[at].tail or (at == len(b.insts) - 2 and not m.frame_bytes))
        ):
            continue
        call = b.insts.pop(at)
        jump = MI("tailcall", call.args[0], line=call.line)
        jump.also_uses = call.also_uses
        b.insts[-1] = jump


def _is_epilogue(mi: MI) -> bool:
    """Whether an instruction belongs to an epilogue, which does not change W0-W7."""
    if mi.op in ("mov", "movd") and isinstance(mi.args[0], Mem) and isinstance(mi.args[1], int):
        return mi.args[1] >= 8 and mi.args[0].base == 15 and mi.args[0].mode == "-"
    return mi.epilogue
