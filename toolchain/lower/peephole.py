"""Clean-up over real registers: branches to the next block, branch chains, dead code."""

from __future__ import annotations

from .mir import CC_INVERSE, MI, MFunction


def run(m: MFunction) -> None:
    """Needs: frame built. Changes layout and removes redundant instructions; keeps behaviour."""
    thread_jumps(m)
    fall_through(m)


def thread_jumps(m: MFunction) -> None:
    """A branch to a block that only jumps goes to the final target; blocks nobody reaches go away."""
    forward: dict[str, str] = {}
    for b in m.blocks:
        if len(b.insts) == 1 and b.insts[0].op == "jump" and not b.address_taken:
            forward[b.name] = str(b.insts[0].args[0])

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
        b.succs = [final(s) for s in b.succs]
    m.tables = [(name, [final(t) for t in targets]) for name, targets in m.tables]
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
                inverted = MI("bra", jump.args[0], cc=CC_INVERSE[bra.cc], line=bra.line)
                b.insts[-2:] = [inverted]
                continue
        if b.insts and b.insts[-1].op == "jump" and b.insts[-1].args[0] == following:
            b.insts.pop()
