"""Rule of the stack: the same depth on all paths into a block, 0 at every return."""

from __future__ import annotations

from toolchain.abi.target import SP
from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import Mem
from toolchain.verify.error import fail

LINK = 1 << 20  # added to the depth between LNK and ULNK, where dynamic changes of the depth are not tracked


def check(m: MFunction, framed: bool, changes: dict[str, int | None]) -> None:
    """Check the depth along every path; before frames are built, check that pushes and pops balance in every block.

    `changes` is `plain_change` of every block. Raises MachineError.
    """
    first = m.blocks[0].name
    depth = {first: 0} | {b.name: 0 for b in m.blocks if not framed}
    blocks = m.block_map()
    work = [first] if framed else [b.name for b in m.blocks]
    while work:
        name = work.pop()
        change, end = changes[name], depth[name]
        if change is None:
            end = _through(blocks[name], end, m)
        elif end < LINK:
            end += change
        if not framed:
            if end:
                fail(f"{end} bytes stay on the stack", name)
            continue
        for s in blocks[name].succs:
            if s not in depth:
                depth[s] = end
                work.append(s)
            elif depth[s] != end and not m.dynamic_stack:
                fail(f"the stack is {depth[s]} or {end} bytes deep", s)


def plain_change(b: MBlock) -> int | None:
    """Bytes that the block adds to the stack; None if it uses the frame pointer or ends the function."""
    if any(mi.op in ("ret", "tailcall") or (mi.op == "text" and _is_link(str(mi.args[0]))) for mi in b.insts):
        return None
    return sum(map(stack_change, b.insts))


def _is_link(text: str) -> bool:
    return text == "ulnk" or text.startswith("lnk ")


def _through(b: MBlock, at: int, m: MFunction) -> int:
    """Depth after a block that starts at depth `at`."""
    for mi in b.insts:
        if mi.op in ("ret", "tailcall") and at and not m.dynamic_stack:
            fail(f"{at} bytes are left on the stack", b.name, mi)
        if mi.op == "text" and mi.args[0] == "ulnk":
            at = 0 if at < LINK else at - LINK
            at -= at % 2
            continue
        if mi.op == "text" and str(mi.args[0]).startswith("lnk "):
            at += LINK
            continue
        if at < LINK:
            at += stack_change(mi)
    return at


def stack_change(mi: MI) -> int:
    """Bytes that an instruction adds to the stack."""
    if mi.op == "spadd" or (mi.op in ("addl", "subl") and mi.args[1] == SP):
        k = mi.number(0)
        return -k if mi.op == "subl" else k
    if mi.op in ("add", "sub") and mi.args[0] == SP and mi.args[2] == SP:
        return mi.number(1) * (1 if mi.op == "add" else -1)
    if mi.op == "repmov" and mi.args[2] == SP:
        return 2 * (mi.number(0) + 1)
    if mi.op == "text":
        word = str(mi.args[0]).split()[0]
        return {"push": 2, "pop": -2}.get(word, 0)
    size = 4 if mi.op == "movd" else 2
    total = 0
    for a in mi.args:
        if isinstance(a, Mem) and a.base == SP:
            total += size if a.mode == "++" else -size if a.mode == "-" else 0
    return total
