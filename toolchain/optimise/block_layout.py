"""Block order: chains of fall-through edges, hottest first (Pettis and Hansen 1990).

Removing an unconditional jump saves a word and two cycles. Edges of such jumps therefore precede conditional edges of
the same loop depth. As a consequence, a loop with the test at the top is laid out with the test at the bottom.
"""

from __future__ import annotations

from toolchain.mir.function import MBlock, MFunction


def run(m: MFunction) -> None:
    """Reorder the blocks; the entry remains first. Needs: explicit branches at the end of every block."""
    order = {b.name: k for k, b in enumerate(m.blocks)}
    depth = {b.name: b.depth for b in m.blocks}
    edges: list[tuple[int, int, int, str, str]] = []
    for b in m.blocks:
        if not b.insts or b.insts[-1].op != "jump":
            continue
        conditional = len(b.insts) > 1 and b.insts[-2].op == "bra"
        for s in b.succs:
            hot = min(depth[b.name], depth[s])
            edges.append((-hot, int(conditional), order[s] - order[b.name] != 1, b.name, s))
    edges.sort(key=lambda e: (e[0], e[1], e[2], order[e[3]], order[e[4]]))
    after: dict[str, str] = {}
    before: dict[str, str] = {}
    head = {n: n for n in order}  # first block of the chain of each block; valid only for the last blocks of chains
    tail = {n: n for n in order}
    entry = m.blocks[0].name
    for _, _, _, a, b_name in edges:
        if a in after or b_name in before or b_name == entry:
            continue
        first, last = head[a], tail[b_name]
        if first == b_name:
            continue
        after[a], before[b_name] = b_name, a
        head[last], tail[first] = first, last
    blocks = m.block_map()
    out: list[MBlock] = []
    for n in order:
        if n not in before:
            at: str | None = n
            while at is not None:
                out.append(blocks[at])
                at = after.get(at)
    m.blocks = out
