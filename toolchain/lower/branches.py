"""Layout and branches: chains, fall-through, skips, tail calls."""

from __future__ import annotations

from .mir import CC_INVERSE, MI, Imm, MBlock, Mem, MFunction


def run(m: MFunction) -> None:
    """Needs: frame built. Changes layout and removes redundant branches; keeps behaviour."""
    thread_jumps(m)
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
    """Drop blocks without predecessors; the first block stays."""
    reached = {m.blocks[0].name} | {s for b in m.blocks for s in b.succs} | {b.name for b in m.blocks if b.address_taken}
    m.blocks = [b for b in m.blocks if b.name in reached]


def fall_through(m: MFunction) -> None:
    """No branch to what follows anyway; a conditional branch over a jump is inverted."""
    for k, b in enumerate(m.blocks):
        following = m.blocks[k + 1].name if k + 1 < len(m.blocks) else ""
        if len(b.insts) >= 2 and b.insts[-1].op == "jump" and b.insts[-2].op == "bra":
            bra, jump = b.insts[-2], b.insts[-1]
            if bra.args[0] == jump.args[0]:
                b.insts.remove(bra)
            elif bra.args[0] == following:
                b.insts[-2:] = [MI("bra", jump.args[0], cc=CC_INVERSE[bra.cc], line=bra.line)]
                continue
        if b.insts and b.insts[-1].op == "jump" and b.insts[-1].args[0] == following:
            b.insts.pop()


# ---------------------------------------------------------------------------------------------------------------------
# skips

SKIP_WHEN = {"z": "cpseq", "nz": "cpsne", "lt": "cpslt", "gt": "cpsgt"}
TWO_WORDS = {"call", "tailcall", "jumpr", "repmov", "repclr", "repfill", "div.s", "div.u", "div.sd", "div.ud", "asm", "text",
             "shiftloop", "brtable", "lea"}  # fmt: skip


def use_skips(b: MBlock) -> None:
    """A comparison and a skip over one instruction become CPSxx or BTSx (isa.md §7.3)."""
    k = 1
    while k < len(b.insts):
        skip = b.insts[k]
        if skip.op == "skip" and skip.count == 1 and not skip.text and k + 1 < len(b.insts):
            guarded, test = b.insts[k + 1], b.insts[k - 1]
            text = _skip_text(test, skip.cc) if guarded.op not in TWO_WORDS else None
            if text is not None and not _flags_needed(b, k):
                skip.text = text
                del b.insts[k - 1]
                continue
        k += 1


def _skip_text(test: MI, cc: str) -> str | None:
    """The skip instruction that skips when `cc` would hold after `test`."""
    if test.op == "cp" and cc in SKIP_WHEN:
        a, c = test.args
        if isinstance(a, int) and isinstance(c, int):
            return f"{SKIP_WHEN[cc]}{'.b' if test.byte else ''} w{a},w{c}"
    if test.op == "btst" and cc in ("z", "nz") and not isinstance(test.args[0], str):
        operand, bit = test.args
        assert isinstance(bit, Imm)
        name = "btsc" if cc == "z" else "btss"
        if isinstance(operand, int):
            return f"{name} w{operand},#{bit.value}"
        if isinstance(operand, Mem) and operand.mode == "ind":
            return f"{name} [w{operand.base}],#{bit.value}"
    if test.op == "btstf" and cc in ("z", "nz"):
        name = "btsc" if cc == "z" else "btss"
        return f"{name}{'.b' if test.byte else ''} {_file(test.args[0])},#{_number(test.args[1])}"
    return None


def _file(a: object) -> str:
    return str(getattr(a, "expr", a))


def _number(a: object) -> int | str:
    assert isinstance(a, Imm)
    return a.value


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
    """CALL, epilogue, RETURN -> epilogue, BRA. The callee returns to our caller; see `MI.tail` for when that is sound."""
    if m.interrupt:
        return
    for b in m.blocks:
        if not b.insts or b.insts[-1].op != "ret" or b.insts[-1].text:
            continue
        at = len(b.insts) - 2
        while at >= 0 and _is_epilogue(b.insts[at]):
            at -= 1
        if at < 0 or b.insts[at].op != "call" or not (b.insts[at].tail or at == len(b.insts) - 2 and not m.frame_bytes):
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
