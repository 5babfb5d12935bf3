"""Control-flow graph: predecessors, loops, dominance order, unreachable blocks, critical edges, dead code."""

from __future__ import annotations

from toolchain.ir.model import VOID, Block, ConstInt, Function, Instr, Value


def predecessors(f: Function) -> dict[str, list[str]]:
    """Names of the predecessors of each block, each once."""
    preds: dict[str, list[str]] = {b.name: [] for b in f.blocks}
    for b in f.blocks:
        for s in b.succs:
            preds[s].append(b.name)
    return preds


def new_branch(target: str) -> Instr:
    """A new unconditional branch."""
    i = Instr("br", VOID, [])
    i.blocks = [target]
    return i


def retarget_phis(block: Block, old: str, new: list[str]) -> None:
    """Replace the predecessor `old` in the phis of `block` by the blocks `new`."""
    for phi in block.phis():
        pairs: list[tuple[Value, str]] = []
        for v, n in zip(phi.args, phi.blocks, strict=True):
            for name in new if n == old else [n]:
                if all(name != seen for _, seen in pairs):
                    pairs.append((v, name))
        phi.args = [v for v, _ in pairs]
        phi.blocks = [n for _, n in pairs]


def remove_unreachable(f: Function) -> None:
    """Remove unreachable blocks and their phi operands."""
    blocks = {b.name: b for b in f.blocks}
    seen = {f.blocks[0].name}
    work = [f.blocks[0]]
    while work:
        for s in work.pop().succs:
            if s not in seen:
                seen.add(s)
                work.append(blocks[s])
    f.blocks = [b for b in f.blocks if b.name in seen]
    for b in f.blocks:
        for phi in b.phis():
            keep = [k for k, n in enumerate(phi.blocks) if n in seen]
            phi.args = [phi.args[k] for k in keep]
            phi.blocks = [phi.blocks[k] for k in keep]


def reverse_postorder(f: Function) -> list[Block]:
    """Reachable blocks in reverse postorder: every block comes after its dominators."""
    blocks = {b.name: b for b in f.blocks}
    order: list[Block] = []
    seen = {f.blocks[0].name}
    stack = [(f.blocks[0], f.blocks[0].succs)]
    while stack:
        block, succs = stack[-1]
        if not succs:
            order.append(block)
            stack.pop()
            continue
        s = succs.pop()
        if s not in seen:
            seen.add(s)
            stack.append((blocks[s], blocks[s].succs))
    order.reverse()
    return order


def use_counts(f: Function) -> dict[int, int]:
    """Number of operands that use each value, by id(value)."""
    counts: dict[int, int] = {}
    for b in f.blocks:
        for i in b.instrs:
            for a in i.args:
                counts[id(a)] = counts.get(id(a), 0) + 1
    return counts


def split_logical_branches(f: Function) -> None:
    """Replace br (a && b) and br (a || b) by two branches, so that no truth value is computed.

    Ensures: a branch condition is a select of i1 only if that select has other uses. Both operands are computed before
    the select, so the order of the two branches does not matter.
    """
    counts = use_counts(f)
    serial = 0
    k = 0
    blocks = {b.name: b for b in f.blocks}
    while k < len(f.blocks):
        block = f.blocks[k]
        k += 1
        br = block.instrs[-1]
        if br.op != "br" or not br.args:
            continue
        c = br.args[0]
        parts = _logical_parts(c) if counts.get(id(c), 0) == 1 and br.blocks[0] != br.blocks[1] else None
        if parts is None:
            continue
        kind, first, second = parts
        serial += 1
        rest = Block(f"{block.name}.and{serial}")
        yes, no = br.blocks
        tail = Instr("br", VOID, [second])
        tail.blocks = [yes, no]
        tail.line = br.line
        rest.instrs = [tail]
        br.args = [first]
        br.blocks = [rest.name, no] if kind == "and" else [yes, rest.name]
        shared, other = (no, yes) if kind == "and" else (yes, no)
        retarget_phis(blocks[shared], block.name, [block.name, rest.name])
        retarget_phis(blocks[other], block.name, [rest.name])
        _sink_compare(block, rest, second, c, counts)
        f.blocks.insert(k, rest)
        blocks[rest.name] = rest
        k -= 1


def _logical_parts(c: Value) -> tuple[str, Value, Value] | None:
    if not isinstance(c, Instr) or c.type.bits != 1:
        return None
    if c.op == "select":
        if isinstance(c.args[2], ConstInt) and c.args[2].value == 0:
            return "and", c.args[0], c.args[1]
        if isinstance(c.args[1], ConstInt) and c.args[1].value == 1:
            return "or", c.args[0], c.args[2]
    if c.op in ("and", "or") and not isinstance(c.args[1], ConstInt):
        return c.op, c.args[0], c.args[1]
    return None


def _sink_compare(block: Block, rest: Block, second: Value, c: Value, counts: dict[int, int]) -> None:
    """Remove the select, and move the second comparison to its branch if the comparison has no other use."""
    if c in block.instrs:
        block.instrs.remove(c)
    if not isinstance(second, Instr) or second.op not in ("icmp", "select", "and", "or"):
        return
    if counts.get(id(second)) == 1 and second in block.instrs:
        block.instrs.remove(second)
        rest.instrs.insert(0, second)


def split_critical_edges(f: Function) -> None:
    """Split critical edges, so that copies of phi operands have a block of their own.

    Ensures: no successor of a block with several successors has phis. Exception: edges of indirectbr cannot be split;
    for them the selector copies values twice.
    """
    blocks = {b.name: b for b in f.blocks}
    k = 0
    while k < len(f.blocks):
        block = f.blocks[k]
        k += 1
        last = block.instrs[-1]
        if last.op == "indirectbr" or len(last.blocks) < 2:
            continue
        made: dict[str, str] = {}
        for at, target in enumerate(last.blocks):
            dest = blocks[target]
            if not dest.instrs or dest.instrs[0].op != "phi":
                continue
            if target not in made:
                middle = Block(f"{block.name}.to.{target}")
                middle.instrs = [new_branch(target)]
                middle.instrs[0].line = last.line
                retarget_phis(dest, block.name, [middle.name])
                blocks[middle.name] = middle
                made[target] = middle.name
                f.blocks.insert(k, middle)
                k += 1
            last.blocks[at] = made[target]


def loop_depths(f: Function) -> dict[str, int]:
    """Loop nesting depth of each block."""
    depth = {b.name: 0 for b in f.blocks}
    for body in natural_loops({b.name: b.succs for b in f.blocks}, f.blocks[0].name).values():
        for n in body:
            depth[n] += 1
    return depth


def natural_loops(succs: dict[str, list[str]], entry: str) -> dict[str, set[str]]:
    """Blocks of the natural loop of each header, from the back edges of a depth-first search.

    Irreducible cycles, which have several entries, are omitted: a backward walk from their tail reaches `entry`.
    """
    state = {entry: 1}
    back: list[tuple[str, str]] = []
    stack = [(entry, list(succs[entry]))]
    while stack:
        name, rest = stack[-1]
        if not rest:
            state[name] = 2
            stack.pop()
            continue
        s = rest.pop()
        if state.get(s, 0) == 1:
            back.append((name, s))
        elif s not in state:
            state[s] = 1
            stack.append((s, list(succs[s])))
    preds: dict[str, list[str]] = {n: [] for n in succs}
    for n, targets in succs.items():
        for s in targets:
            preds[s].append(n)
    bodies: dict[str, set[str]] = {}
    for tail, head in back:
        body = bodies.setdefault(head, {head})
        work = [tail]
        while work:
            n = work.pop()
            if n not in body:
                body.add(n)
                work += preds[n]
    return {head: body for head, body in bodies.items() if head == entry or entry not in body}


def dead_code(f: Function) -> None:
    """Remove instructions without side effects whose value is not used."""
    counts = use_counts(f)
    for b in reversed(f.blocks):
        kept = []
        for i in reversed(b.instrs):
            if i.op in NO_SIDE_EFFECTS and not counts.get(id(i), 0) and not i.volatile:
                for a in i.args:
                    counts[id(a)] -= 1
            else:
                kept.append(i)
        kept.reverse()
        b.instrs = kept


NO_SIDE_EFFECTS = frozenset((
    "add", "sub", "mul", "and", "or", "xor", "shl", "lshr", "ashr", "udiv", "sdiv", "urem", "srem", "zext",
    "sext", "trunc",
    "icmp", "select", "phi", "load", "slot", "bits", "ff1l", "ff1r", "swap", "getsp", "vastart", "divother",
    "callresult",
    "entryword",
    "argword",
))  # fmt: skip


def sink_compares(f: Function) -> None:
    """Copy comparisons of other blocks before the branch or select that uses them, for selection to fuse the two."""
    home: dict[int, str] = {id(i): b.name for b in f.blocks for i in b.instrs}
    for b in f.blocks:
        at = 0
        while at < len(b.instrs):
            i = b.instrs[at]
            c = i.args[0] if i.args and (i.op == "br" or i.op == "select") else None
            if isinstance(c, Instr) and c.op == "icmp" and home.get(id(c)) != b.name:
                copy = Instr("icmp", c.type, list(c.args))
                copy.extra = c.extra
                copy.line = i.line
                i.args[0] = copy
                home[id(copy)] = b.name
                b.instrs.insert(at, copy)
                at += 1
            at += 1
    dead_code(f)
