"""Writes of one bit of a volatile object in near memory, back where the source has them.

BSET, BCLR and BTG change one bit in one instruction (isa.md §5.4), so an interrupt in between loses no other bit; what
programs do to flags of the hardware counts on that. The front end clears a bit-field before it sets it; here both are
one operation. The middle end knows no such instruction. Of branches, or of a switch, that each write a bit it makes

    one store behind them, of a phi        the store moves back into the branches
    one load in front of them              the load moves back into the branches
    a choice of the value that is stored   the choice becomes branches again
    a bit that is put into the old value   the same, on that bit

Needs: legal IR without critical edges. Every way makes the same accesses in the same order as before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from toolchain.abi.target import NEAR_END
from toolchain.ir.cfg import dead_code, new_branch, predecessors
from toolchain.ir.model import I1, VOID, Block, ConstInt, Function, GlobalRef, Instr, Value
from toolchain.optimise.combine import users_of
from toolchain.select.state import MEMORY_BARRIERS

Near = Callable[[str], bool]
Change = tuple[Instr, str, int]
"""The load, and what one operation with one constant makes of it."""


@dataclass(frozen=True)
class Choice:
    """A value that is one change of a load where `asked` has a bit of `mask`, and another change of it elsewhere."""

    asked: Value
    mask: int
    first: Change
    second: Change
    own: frozenset[int]  # identities of the instructions that make it from the load, which is one of them


def run(f: Function, near: Near) -> None:
    """Undo the four for every store of the function; `near` tells whether a variable is in near memory."""
    one_operation(f)
    for b in f.blocks:
        _store_in_branches(f, b, near)
    written = _bits_written(f, near)
    for b in f.blocks if written else ():
        _load_in_branches(f, b, near, written)
    for b in list(f.blocks):
        _branches_for_choice(f, b, near)
    dead_code(f)


def one_operation(f: Function) -> None:
    """Several operations that change one bit of a volatile object become one, wherever the object is."""
    users = users_of(f)
    for b in f.blocks:
        for store in [i for i in b.instrs if i.op == "store" and i.volatile]:
            value, p = store.args
            change = _change(value, p)
            steps = _chain(value)[1]
            if change is None or len(steps) < 2 or any(len(users[id(i)]) > 1 for i in (change[0], *steps)):
                continue
            last, (old, op, k) = steps[-1], change
            last.op, last.extra, last.args = op, {}, [old, ConstInt(old.type, k)]
    dead_code(f)


def _bits_written(f: Function, near: Near) -> list[Value]:
    """Places to which a store of the function writes one bit."""
    stores = [(i, _place(i, near)) for b in f.blocks for i in b.instrs if i.op == "store"]
    return [p for i, p in stores if p is not None and _writes(i.args[0], p)]


def _place(i: Instr, near: Near) -> Value | None:
    """Where a volatile access of a byte or word goes, if that is a fixed place in near memory."""
    if i.op not in ("load", "store") or not i.volatile:
        return None
    t, p = (i.type if i.op == "load" else i.args[0].type), i.args[-1]
    if t.bits not in (8, 16):
        return None
    if isinstance(p, ConstInt):
        return p if p.value < NEAR_END else None
    return p if isinstance(p, GlobalRef) and near(p.name) else None


def _same(p: Value, q: Value) -> bool:
    if p is q:
        return True
    if isinstance(p, GlobalRef) and isinstance(q, GlobalRef):
        return (p.name, p.offset) == (q.name, q.offset)
    return isinstance(p, ConstInt) and isinstance(q, ConstInt) and p.value == q.value


def _chain(v: Value) -> tuple[Value, list[Instr]]:
    """What operations with constants start from, and these in order."""
    steps: list[Instr] = []
    while isinstance(v, Instr) and v.op in ("and", "or", "xor") and isinstance(v.args[1], ConstInt):
        steps.insert(0, v)
        v = v.args[0]
    return v, steps


def _change(v: Value, p: Value) -> Change | None:
    """How a value is the volatile object at `p` with one bit changed; None if it is not."""
    load, steps = _chain(v)
    if not isinstance(load, Instr) or load.op != "load" or not load.volatile or load.type is not v.type:
        return None
    return _one_bit(load, (1 << v.type.bits) - 1, 0, steps) if _same(load.args[0], p) else None


def _one_bit(load: Instr, kept: int, flipped: int, steps: list[Instr]) -> Change | None:
    """What operations make of load & kept ^ flipped; None if that is not one bit changed."""
    ones = (1 << load.type.bits) - 1
    for step in steps:
        constant = step.args[1]
        assert isinstance(constant, ConstInt)
        k = constant.value
        if step.op == "and":
            kept, flipped = kept & k, flipped & k
        elif step.op == "or":
            kept, flipped = kept & ~k, flipped & ~k | k
        else:
            flipped ^= k
    bit = ~kept & ones | flipped
    if bit == 0 or bit & (bit - 1):
        return None
    if kept == ones:
        return load, "xor", bit
    return (load, "or", bit) if flipped else (load, "and", kept)


def _choice(v: Value, p: Value) -> Choice | None:
    """How a value is one of two changes of one bit of the volatile object at `p`; None if it is not."""
    root, steps = _chain(v)
    if not isinstance(root, Instr) or len(root.args) < 2:
        return None
    if root.op == "select" and not steps:
        asked, one, other = root.args
        first, second = _change(one, p), _change(other, p)
        inner, mask = [*_chain(one)[1], *_chain(other)[1]], 1
    elif root.op == "or":
        kept, asked = root.args if _change(root.args[0], p) is not None else reversed(root.args)
        cleared = _change(kept, p)
        if cleared is None or cleared[1] != "and":
            return None
        load, _, rest = cleared
        mask = ~rest & (1 << v.type.bits) - 1
        if _possible(asked) != mask:
            return None
        first, second = _one_bit(load, rest, mask, steps), _one_bit(load, rest, 0, steps)
        inner = [*_chain(kept)[1], *steps]
    else:
        return None
    if first is None or second is None or first[0] is not second[0] or asked is first[0]:
        return None
    return Choice(asked, mask, first, second, frozenset(id(i) for i in (first[0], root, *inner)))


def _possible(v: Value) -> int:
    """The bits of a value that may be 1."""
    ones = (1 << v.type.bits) - 1
    if isinstance(v, ConstInt):
        return v.value & ones
    if not isinstance(v, Instr):
        return ones
    by = v.args[1].value if len(v.args) == 2 and isinstance(v.args[1], ConstInt) else None
    if v.op == "and":
        return _possible(v.args[0]) & _possible(v.args[1])
    if v.op == "shl" and by is not None:
        return _possible(v.args[0]) << by & ones
    if v.op == "lshr" and by is not None:
        return _possible(v.args[0]) >> by
    if v.op in ("zext", "trunc"):
        return _possible(v.args[0]) & ones
    return ones


def _truth(v: Value, mask: int, made: list[Instr]) -> Value:
    """Whether a value has a bit of `mask`, as an i1; what must be computed for it goes behind `made`."""
    if v.type is I1:
        return v
    if isinstance(v, Instr) and v.op in ("zext", "trunc"):
        return _truth(v.args[0], mask & (1 << v.args[0].type.bits) - 1, made)
    if isinstance(v, Instr) and v.op in ("and", "shl", "lshr") and isinstance(v.args[1], ConstInt):
        k, ones = v.args[1].value, (1 << v.type.bits) - 1
        below = mask & k if v.op == "and" else mask >> k if v.op == "shl" else mask << k & ones
        return _truth(v.args[0], below, made)
    bits = Instr("and", v.type, [v, ConstInt(v.type, mask)])
    there = Instr("icmp", I1, [bits, ConstInt(v.type, 0)])
    there.extra["pred"] = "ne"
    made += [bits, there]
    return there


def _writes(v: Value, p: Value) -> bool:
    """Whether a store of the value to `p` is to be the write of one bit, or a choice of two."""
    return _change(v, p) is not None or _choice(v, p) is not None


def _written(p: Value, change: Change, line: str | None) -> list[Instr]:
    """Load, operation and store."""
    old, op, k = change
    load = Instr("load", old.type, [p])
    new = Instr(op, old.type, [load, ConstInt(old.type, k)])
    store = Instr("store", VOID, [new, p])
    load.volatile = store.volatile = True
    load.line, new.line, store.line = old.line, line, line
    return [load, new, store]


def _store_in_branches(f: Function, b: Block, near: Near) -> None:
    """store phi(...) at the start of a block, all ways into which lead nowhere else: a store at the end of each."""
    phis = list(b.phis())
    store = b.instrs[len(phis)]
    p, v = _place(store, near), store.args[0] if store.args else None
    phi = next((i for i in phis if i is v), None)
    if p is None or phi is None or store.op != "store" or len(users_of(f)[id(phi)]) != 1:
        return
    blocks = {x.name: x for x in f.blocks}
    sources = [blocks[name] for name in phi.blocks]
    if sorted(phi.blocks) != sorted(predecessors(f)[b.name]):
        return
    if any(s.instrs[-1].op != "br" or s.instrs[-1].args for s in sources):
        return
    whole = sum(1 for x in phi.args if not _writes(x, p))
    if whole > 1 or whole == len(phi.args):
        return
    for s, x in zip(sources, phi.args, strict=True):
        moved = Instr("store", VOID, [x, p])
        moved.volatile, moved.line = True, store.line
        s.instrs.insert(len(s.instrs) - 1, moved)
    b.instrs.remove(store)
    b.instrs.remove(phi)
    for record in f.dbg_records:
        if record.value is phi:
            record.value = None
    for s in sources:
        _store_in_branches(f, s, near)


def _load_in_branches(f: Function, b: Block, near: Near, written: list[Value]) -> None:
    """The last access of a block that goes on to two others, which alone want its value: a load in each of them.

    Blocks without an access are passed; a switch is a tree of such blocks by now.
    """
    at = next((k for k in range(len(b.instrs) - 1, -1, -1) if _accesses(b.instrs[k])), None)
    ways = b.instrs[-1]
    if at is None or ways.op != "br" or not ways.args or len(set(ways.blocks)) != 2:
        return
    load = b.instrs[at]
    p = _place(load, near)
    if p is None or load.op != "load" or not any(_same(p, q) for q in written):
        return
    targets = [x for x in f.blocks if x.name in ways.blocks]
    preds = predecessors(f)
    if any(preds[t.name] != [b.name] for t in targets):
        return
    behind = [_behind(f, t, preds) for t in targets]
    inside = {id(i) for blocks in behind for x in blocks for i in x.instrs}
    if any(u.op == "phi" or id(u) not in inside for u in users_of(f).get(id(load), [])):
        return
    if not any(_writes_bit(i, load, p, near) for blocks in behind for x in blocks for i in x.instrs):
        return
    b.instrs.remove(load)
    for t, blocks in zip(targets, behind, strict=True):
        again = Instr("load", load.type, [p])
        again.volatile, again.line = True, load.line
        for i in (i for x in blocks for i in x.instrs):
            i.args = [again if a is load else a for a in i.args]
        t.instrs.insert(len(list(t.phis())), again)
    for record in f.dbg_records:
        if record.value is load:
            record.value = None
    for t in targets:
        _load_in_branches(f, t, near, written)


def _behind(f: Function, t: Block, preds: dict[str, list[str]]) -> list[Block]:
    """The block, and those that only blocks without an access lie between it and, with no other way to them."""
    found = [t]
    for x in found:
        if not any(_accesses(i) for i in x.instrs):
            found += [y for y in f.blocks if y.name in x.succs and preds[y.name] == [x.name]]
    return found


def _accesses(i: Instr) -> bool:
    return i.volatile or i.op in MEMORY_BARRIERS


def _writes_bit(i: Instr, load: Instr, p: Value, near: Near) -> bool:
    """Whether a store changes one bit of what was loaded."""
    to = _place(i, near)
    if i.op != "store" or to is None or not _same(to, p):
        return False
    change, choice = _change(i.args[0], p), _choice(i.args[0], p)
    return (change or (choice.first if choice is not None else (None,)))[0] is load


def _branches_for_choice(f: Function, b: Block, near: Near) -> None:
    """store of a choice of two changes of the load: a branch for each, until the block has no such store."""
    for store in [i for i in b.instrs if i.op == "store"]:
        p = _place(store, near)
        choice = _choice(store.args[0], p) if p is not None else None
        if p is None or choice is None:
            continue
        load, value = choice.first[0], store.args[0]
        if load not in b.instrs or value not in b.instrs or not _alone(f, choice.own, store):
            continue
        between = b.instrs[b.instrs.index(load) + 1 : b.instrs.index(store)]
        if any(_accesses(i) for i in between):
            continue
        b = _split(f, b, store, choice, [_written(p, x, store.line) for x in (choice.first, choice.second)])


def _alone(f: Function, own: frozenset[int], store: Instr) -> bool:
    """Whether only these and the store use the values of these."""
    users = users_of(f)
    return all(u is store or id(u) in own for i in own for u in users.get(i, ()))


def _split(f: Function, b: Block, store: Instr, choice: Choice, bodies: list[list[Instr]]) -> Block:
    """Cut `b` at the store, which two blocks take the place of; returns the block behind them."""
    at = b.instrs.index(store)
    end = Block(f"{b.name}.written", b.instrs[at + 1 :])
    b.instrs = [i for i in b.instrs[:at] if id(i) not in choice.own]
    asking: list[Instr] = []
    branch = new_branch("")
    branch.args, branch.line, branch.blocks = [_truth(choice.asked, choice.mask, asking)], store.line, []
    made: list[Block] = []
    for k, body in enumerate(bodies):
        made.append(Block(f"{b.name}.bit{k}", [*body, new_branch(end.name)]))
        branch.blocks.append(made[-1].name)
    b.instrs += [*asking, branch]
    for x in f.blocks:
        if x.name in end.succs:
            for phi in x.phis():
                phi.blocks = [end.name if name == b.name else name for name in phi.blocks]
    place = f.blocks.index(b) + 1
    f.blocks[place:place] = [*made, end]
    for record in f.dbg_records:
        if id(record.value) in choice.own:
            record.value = None
    return end
