"""Layout and branches: chains, fall-through, skips, tail calls."""

from __future__ import annotations

import copy

from toolchain.mir.liveness import bits, live_out, summary
from toolchain.mir.mir import CC_INVERSE, MI, File, Imm, MBlock, Mem, MFunction, covered
from toolchain.optimise import block_layout
from toolchain.optimise.peephole import ALL, AT_RETURN


def run(m: MFunction, reorder: bool) -> None:
    """Needs: frame built. Removes redundant branches, and changes the order of blocks if allowed; keeps behaviour."""
    thread_jumps(m)
    if reorder:
        thread_constants(m)
        hoist_edge_moves(m)
        thread_jumps(m)
        block_layout.run(m)
    fall_through(m)
    thread_jumps(m)
    for b in m.blocks:
        use_skips(b)


def thread_jumps(m: MFunction) -> None:
    """A branch to a block that only jumps goes to the final target; blocks nobody reaches go away."""
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
                mi.args[0] = final(str(mi.args[0]))
        b.succs = list(dict.fromkeys(final(s) for s in b.succs))
    m.tables = [(name, [final(t) for t in targets]) for name, targets in m.tables]
    remove_unreached(m)


def remove_unreached(m: MFunction) -> None:
    """Drop blocks control cannot reach from the entry or through an address."""
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
    """No branch to what follows anyway; a conditional branch over a jump is inverted."""
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
    """Moves on one edge of a conditional branch go before it, when the other edge does not see them.

    The edge's block then only jumps, and the branch can go straight to its target. Moves leave the flags alone.
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
            if bits([r for mi in moves for r in mi.defs()]) & live_in(blocks[other], out[other]):
                continue
            b.insts[-2:-2] = moves
            edge.insts = edge.insts[-1:]
            break


MAX_HOISTED = 3


def _is_neutral(mi: MI) -> bool:
    """A register move or constant load that touches neither flags nor memory."""
    return mi.op in NEUTRAL and not mi.byte and not mi.pred and all(isinstance(a, int | Imm) for a in mi.args)


def live_in(block: MBlock, live: int) -> int:
    """Registers live at the start of a block, from those live at its end. Moving copies up an edge leaves them as they
    are for every block but the emptied one, so one analysis serves the whole pass."""
    reads, kill = summary(block)
    return reads | live & ~kill


def thread_constants(m: MFunction) -> None:
    """A jump to a block that only compares a register with a constant, from where the register is known."""
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
        b.succs = list(dict.fromkeys(str(mi.args[0]) for mi in b.insts if mi.op in ("bra", "jump")))


def _decide(b: MBlock, test: MI, cc: str) -> bool | None:
    """Outcome of `test; bra cc` with the constants the block leaves in registers, or None."""
    if test.op not in ("cp", "cp0") or not isinstance(test.args[0], int):
        return None
    right = test.args[1] if test.op == "cp" else Imm(0)
    if not isinstance(right, Imm) or not isinstance(right.value, int):
        return None
    value = _known_value(b, test.args[0])
    if value is None:
        return None
    mask = 0xFF if test.byte else 0xFFFF
    return _holds(cc, value & mask, right.value & mask, mask)


def _known_value(b: MBlock, r: int) -> int | None:
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


def _holds(cc: str, a: int, b: int, mask: int) -> bool | None:
    """Condition after comparing a with b, for the conditions that follow CP."""
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
    """A comparison and a skip over one instruction become CPSxx or BTSx (isa.md §7.3)."""
    k = 1
    while k < len(b.insts):
        skip = b.insts[k]
        if skip.op == "skip" and covered(b.insts, k) == 1 and b.insts[k + 1].op not in TWO_WORDS:
            short = _short_skip(b.insts[k - 1], skip)
            if short is not None and not _flags_needed(b, k):
                b.insts[k - 1 : k + 1] = [short]
                continue
        k += 1


def _short_skip(test: MI, skip: MI) -> MI | None:
    """The instruction that does what `test` and `skip` do."""
    if test.op == "cp" and skip.cc in SKIP_WHEN and all(isinstance(a, int) for a in test.args):
        return MI(SKIP_WHEN[skip.cc], *test.args, byte=test.byte, line=skip.line)
    if test.op in ("btst", "btstf") and skip.cc in ("z", "nz"):
        operand = test.args[0]
        if isinstance(operand, int | File) or (isinstance(operand, Mem) and operand.mode == "ind"):
            name = ("btsc" if skip.cc == "z" else "btss") + test.op.removeprefix("btst")
            return MI(name, *test.args, byte=test.byte, line=skip.line)
    return None


def _flags_needed(b: MBlock, skip_at: int) -> bool:
    """Whether flags of the comparison are read after the guarded instruction."""
    for mi in b.insts[skip_at + 1 :]:
        if mi.flags_read():
            return True
        if mi.info.writes and not mi.pred:
            return False
    return False


# ---------------------------------------------------------------------------------------------------------------------
# tail calls


def tail_calls(m: MFunction) -> None:
    """CALL, epilogue, RETURN -> epilogue, BRA: the callee returns to our caller. `MI.tail` says when that is sound.

    A branch to a bare RETURN counts as one.
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
    """Instructions `frame` puts before RETURN, which leave W0-W7 alone."""
    if mi.op in ("mov", "movd") and isinstance(mi.args[0], Mem) and isinstance(mi.args[1], int):
        return mi.args[1] >= 8 and mi.args[0].base == 15 and mi.args[0].mode == "-"
    return mi.epilogue
