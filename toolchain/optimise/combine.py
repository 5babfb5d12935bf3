"""Target-specific rewrites of legal IR that LLVM's middle end does not perform.

reuse_quotients              x < c becomes x / c == 0 if x / c is computed anyway, so that x is not live after the
                             division
recover_remainders           x - x/c*c becomes x % c again
pair_divisions               quotient and remainder of one division share one DIV (isa.md §6.7)
make_operations_conditional  x op (c ? y : 0) becomes c ? x op y : x, whose operation a skip can cover
group_selects                selects on one condition are adjacent and share the test
sink_increments              steps of pointers and counters move after the last use of the old value, so that both
                             share a register and the step can become a post-increment
hoist_block_steps            steps by the size of a block move before its copy, which advances the pointer
move_countdowns              the decrement of `n-- != 0` moves to the test, which then uses its carry
"""

from __future__ import annotations

from toolchain.ir.cfg import dead_code, loop_depths, predecessors, reverse_postorder, use_counts
from toolchain.ir.model import Block, ConstInt, Function, GlobalRef, Instr, Value
from toolchain.legalize import magic
from toolchain.legalize.magic import REMAINDER
from toolchain.optimise import induction
from toolchain.select.compare import COUNTDOWN_CONDITION


def users_of(f: Function) -> dict[int, list[Instr]]:
    """Instructions that use the value of each instruction, by id(instruction)."""
    out: dict[int, list[Instr]] = {}
    for b in f.blocks:
        for i in b.instrs:
            for a in i.args:
                if isinstance(a, Instr):
                    out.setdefault(id(a), []).append(i)
    return out


def combine(f: Function, for_size: bool, for_speed: bool = False) -> None:
    """Apply all rewrites. Needs: legal IR."""
    reuse_quotients(f)
    make_operations_conditional(f)
    group_selects(f)
    recover_remainders(f, for_size)
    magic.run(f, for_size, for_speed)
    pair_divisions(f)
    induction.run(f)
    sink_increments(f)
    hoist_block_steps(f)
    move_countdowns(f)


def reuse_quotients(f: Function) -> None:
    """Replace icmp x, c by icmp (x udiv c), 0 in blocks that contain the division."""
    for b in f.blocks:
        divided: dict[tuple[int, int], Instr] = {}
        for i in b.instrs:
            if i.op == "udiv" and isinstance(i.args[1], ConstInt):
                divided[id(i.args[0]), i.args[1].value] = i
            if i.op != "icmp" or not isinstance(i.args[1], ConstInt) or i.pred not in ("ult", "ugt", "ule", "uge"):
                continue
            below = i.args[1].value + (i.pred in ("ugt", "ule"))  # the comparison is x < below, or its negation
            quotient = divided.get((id(i.args[0]), below))
            if quotient is not None:
                i.args = [quotient, ConstInt(quotient.type, 0)]
                i.extra["pred"] = "eq" if i.pred in ("ult", "ule") else "ne"


NEUTRAL_RIGHT = ("add", "sub", "or", "xor")  # operations for which x op 0 is x


def make_operations_conditional(f: Function) -> None:
    """Replace x op select(c, y, 0) by select(c, x op y, x), and its mirror image, if the select has no other use."""
    counts = use_counts(f)
    for b in f.blocks:
        made: list[Instr] = []
        here: set[int] = set()
        for i in b.instrs:
            here.add(id(i))
            new = _conditional(i, counts, here) if i.op in NEUTRAL_RIGHT and i.type.bits in (8, 16, 32) else None
            if new is not None:
                made.append(new)
            made.append(i)
        b.instrs = made
    dead_code(f)


def _conditional(i: Instr, counts: dict[int, int], here: set[int]) -> Instr | None:
    """Turn `i` into the select; return the operation to insert before it, or None if the rewrite does not apply."""
    a, b = i.args
    for x, chosen in ((a, b), (b, a)) if i.op != "sub" else ((a, b),):
        if not isinstance(chosen, Instr) or chosen.op != "select" or counts[id(chosen)] != 1 or id(chosen) not in here:
            continue
        c, yes, no = chosen.args
        zero = next((k for k, v in enumerate((yes, no)) if isinstance(v, ConstInt) and not v.value), None)
        if zero is None or isinstance(x, ConstInt | GlobalRef):
            continue
        operation = Instr(i.op, i.type, [x, yes if zero else no])
        operation.line = i.line
        i.op, i.extra = "select", {}
        i.args = [c, operation, x] if zero else [c, x, operation]
        return operation
    return None


def group_selects(f: Function) -> None:
    """Move a select down to the next one on the same condition, if no instruction in between uses it."""
    for b in f.blocks:
        last: dict[int, Instr] = {}
        for i in [x for x in b.instrs if x.op == "select"]:
            earlier = last.get(id(i.args[0]))
            last[id(i.args[0])] = i
            if earlier is None:
                continue
            at, to = b.instrs.index(earlier), b.instrs.index(i)
            if not any(earlier in x.args for x in b.instrs[at + 1 : to + 1]):
                b.instrs.insert(to - 1, b.instrs.pop(at))


def recover_remainders(f: Function, for_size: bool) -> None:
    """Replace sub x, (mul (div x, c), c) by rem x, c.

    For c = 2^k the product is a shift, and the remainder saves only words, because DIV computes both results."""
    for b in f.blocks:
        for i in b.instrs:
            if i.op == "sub" and i.type.bits == 16:
                _recover_remainder(i, for_size)
            elif i.op == "add" and i.type.bits == 16:
                _recover_negative(i)


def _division_of(x: Value, product: Value, sign: int, shifts: bool) -> tuple[Instr, Value] | None:
    """(division q = x / c, c) for product = q * (sign*c), with `shifts` also for q << k with c = 2^k; else None."""
    if not isinstance(product, Instr) or product.op not in ("mul", "shl"):
        return None
    q, c = product.args
    if not isinstance(q, Instr) or q.op not in REMAINDER or q.args[0] is not x:
        return None
    d = q.args[1]
    if product.op == "shl":
        if not shifts or q.op != "sdiv" or not isinstance(d, ConstInt) or not isinstance(c, ConstInt):
            return None
        return (q, d) if d.signed == 1 << c.value else None
    if isinstance(d, ConstInt) and isinstance(c, ConstInt):
        return (q, d) if (d.value * sign - c.value) % 0x10000 == 0 else None
    return (q, d) if d is c and sign > 0 else None


def _recover_remainder(i: Instr, for_size: bool) -> None:
    found = _division_of(i.args[0], i.args[1], 1, for_size)
    if found is not None:
        i.op = REMAINDER[found[0].op]
        i.args = [i.args[0], found[1]]


def _recover_negative(i: Instr) -> None:
    """Replace x + q * -c by a remainder; the middle end writes x - q * c in this form for constants c."""
    for x, product in ((i.args[0], i.args[1]), (i.args[1], i.args[0])):
        found = _division_of(x, product, -1, False)
        if found is not None:
            i.op = REMAINDER[found[0].op]
            i.args = [x, found[1]]
            return


def pair_divisions(f: Function) -> None:
    """Let a quotient and a remainder of the same operands in one block share one DIV."""
    for b in f.blocks:
        seen: dict[tuple[str, int, object], Instr] = {}
        for i in b.instrs:
            if i.op not in ("udiv", "sdiv", "urem", "srem") or i.type.bits != 16:
                continue
            d = i.args[1]
            key = (i.op[0], id(i.args[0]), d.value if isinstance(d, ConstInt) else id(d))
            first = seen.get(key)
            if first is None:
                seen[key] = i
            elif first.op != i.op:
                _share(first, i)


def _share(first: Instr, second: Instr) -> None:
    """Turn `second` into the other result of `first`'s DIV."""
    if "other" in first.extra:
        return
    second.op = "divother"
    second.args = [first]
    first.extra["other"] = second


def sink_increments(f: Function) -> None:
    """Move the step p + constant of a phi p after the last use of p."""
    users = users_of(f)
    depths = loop_depths(f)
    dominators = immediate_dominators(f)
    home = {id(i): b for b in f.blocks for i in b.instrs}
    for b in f.blocks:
        for i in [x for x in b.instrs if x.op == "add" and isinstance(x.args[1], ConstInt)]:
            p = i.args[0]
            if not isinstance(p, Instr) or p.op != "phi" or p.type.bits != 16:
                continue
            if any(u.op != "phi" for u in users.get(id(i), ())):
                _to_last_use(b, i, users)
                continue
            others = [u for u in users[id(p)] if u is not i]
            using = {id(home[id(u)]): home[id(u)] for u in others}
            behind = _last_using_block(_using_blocks(p, others, home, f), b, users[id(i)], dominators)
            if behind is not None and depths[behind.name] == depths[b.name]:
                b.instrs.remove(i)
                behind.instrs.insert(len(behind.instrs) - 1, i)
                home[id(i)] = behind
                _to_last_use(behind, i, users)
                continue
            if any(u.op == "phi" for u in others):
                continue
            if len(using) == 1 and all(u.op in ("load", "store", "add") for u in others):
                target = next(iter(using.values()))
                if target is not b and depths[target.name] <= depths[b.name] and _dominates(dominators, target, b):
                    b.instrs.remove(i)
                    target.instrs.insert(len(target.instrs) - 1, i)
                    home[id(i)] = target
                    _to_last_use(target, i, users)
                    continue
            _to_last_use(b, i, users)


def hoist_block_steps(f: Function) -> None:
    """Move p + size before the copy or fill of a block of that size at p, which advances p by that size."""
    for b in f.blocks:
        for block in [i for i in b.instrs if i.op in ("blockcopy", "blockfill")]:
            count, unit = block.extra["count"], block.extra["unit"]
            size, at = count * unit, b.instrs.index(block)
            for step in [i for i in b.instrs[at:] if i.op == "add" and i.args[0] in block.args[:2]]:
                if isinstance(step.args[1], ConstInt) and step.args[1].signed == size:
                    b.instrs.remove(step)
                    b.instrs.insert(at, step)


def _using_blocks(p: Instr, users: list[Instr], home: dict[int, Block], f: Function) -> list[Block]:
    """Blocks that use `p`; a phi uses it at the end of the incoming block."""
    blocks = {b.name: b for b in f.blocks}
    found: dict[str, Block] = {}
    for u in users:
        ends = [blocks[n] for v, n in zip(u.args, u.blocks, strict=True) if v is p] if u.op == "phi" else [home[id(u)]]
        found |= {b.name: b for b in ends}
    return list(found.values())


def _last_using_block(using: list[Block], b: Block, phis: list[Instr], idom: dict[str, str]) -> Block | None:
    """The block after `b` that all others of `using` dominate, if it dominates the edge to the phi of the step."""
    last = next((t for t in using if all(_dominates(idom, other, t) for other in using)), None)
    if last is None or last is b or not _dominates(idom, b, last):
        return None
    step = {name for phi in phis for v, name in zip(phi.args, phi.blocks, strict=True)
            if isinstance(v, Instr) and v.op == "add" and v.args[0] is phi}  # fmt: skip
    return last if len(phis) == 1 and len(step) == 1 and _named_dominates(idom, last.name, next(iter(step))) else None


def _to_last_use(b: Block, i: Instr, users: dict[int, list[Instr]]) -> None:
    """Move `i` before its first use in the block, or before the terminator if it has none."""
    position = {id(x): k for k, x in enumerate(b.instrs)}
    uses = [position[id(u)] for u in users.get(id(i), ()) if u.op != "phi" and id(u) in position]
    target = min(uses, default=len(b.instrs) - 1)
    here = position[id(i)]
    if target > here + 1:
        b.instrs.remove(i)
        b.instrs.insert(target - 1, i)


def immediate_dominators(f: Function) -> dict[str, str]:
    """Immediate dominator of each block (Cooper, Harvey, Kennedy: A Simple, Fast Dominance Algorithm)."""
    order = [b.name for b in reverse_postorder(f)]
    number = {n: k for k, n in enumerate(order)}
    preds = predecessors(f)
    idom: dict[str, str] = {order[0]: order[0]}
    changed = True
    while changed:
        changed = False
        for n in order[1:]:
            new = ""
            for p in preds[n]:
                if p in idom:
                    new = p if not new else _intersect(idom, number, p, new)
            if idom.get(n) != new:
                idom[n] = new
                changed = True
    return idom


def _intersect(idom: dict[str, str], number: dict[str, int], a: str, b: str) -> str:
    while a != b:
        while number[a] > number[b]:
            a = idom[a]
        while number[b] > number[a]:
            b = idom[b]
    return a


def _dominates(idom: dict[str, str], a: Block, b: Block) -> bool:
    return _named_dominates(idom, a.name, b.name)


def _named_dominates(idom: dict[str, str], a: str, b: str) -> bool:
    n = b
    while n != a:
        if idom[n] == n:
            return False
        n = idom[n]
    return True


def move_countdowns(f: Function) -> None:
    """Move y = x - 1 to a branch on x == 0 or x == 1, from the branch's block or a successor that only it reaches."""
    preds = predecessors(f)
    blocks = {b.name: b for b in f.blocks}
    users = users_of(f)
    for b in f.blocks:
        br = b.instrs[-1]
        c = br.args[0] if br.op == "br" and br.args else None
        if not isinstance(c, Instr) or c.op != "icmp" or c not in b.instrs:
            continue
        x, zero = c.args
        if not isinstance(zero, ConstInt) or x.type.bits not in (8, 16) or not isinstance(x, Instr):
            continue
        if not zero.value and x.op == "add" and x in b.instrs:
            _to_test(b, x, c, users)
        if zero.value > 1 or c.pred not in COUNTDOWN_CONDITION[zero.value]:
            continue
        for source in [b, *(blocks[s] for s in br.blocks if preds[s] == [b.name])]:
            step = next((i for i in source.instrs if _is_decrement(i, x)), None)
            if step is None or any(u.op != "phi" for u in users.get(id(step), ()) if source is b and u in b.instrs):
                continue
            source.instrs.remove(step)
            b.instrs.insert(len(b.instrs) - 1, step)
            break


def _to_test(b: Block, step: Instr, c: Instr, users: dict[int, list[Instr]]) -> None:
    """Move a step and the test of its result directly before the branch, which then uses the flags of the step."""
    alone = all(u is c or u.op == "phi" or u not in b.instrs for u in users.get(id(step), ()))
    if alone and users.get(id(c)) == [b.instrs[-1]]:
        b.instrs = [*(i for i in b.instrs[:-1] if i is not step and i is not c), step, c, b.instrs[-1]]


def _is_decrement(i: Instr, x: Value) -> bool:
    return i.op == "add" and i.args[0] is x and isinstance(i.args[1], ConstInt) and i.args[1].signed == -1
