"""Writes of one bit of a volatile object in near memory, back where the source has them.

BSET, BCLR and BTG change one bit in one instruction (isa.md §5.4), so an interrupt in between loses no other bit; what
programs do to flags of the hardware counts on that. The middle end knows no such instruction. Of branches that each
write a bit it makes

    one store behind them, of a phi        the store moves back into the branches
    one load in front of them              the load moves back into the branches
    a choice of the value that is stored   the choice becomes branches again

Needs: legal IR without critical edges. Every way makes the same accesses in the same order as before.
"""

from __future__ import annotations

from collections.abc import Callable

from ..ir.model import VOID, Block, ConstInt, Function, GlobalRef, Instr, Value
from ..target import NEAR_END
from .cfg import dead_code, new_branch, predecessors
from .combine import users_of
from .values import MEMORY_BARRIERS

Near = Callable[[str], bool]
Change = tuple[Instr, str, int]
"""The load, and what one operation with one constant makes of it."""


def run(f: Function, near: Near) -> None:
    """Undo the three for every store of the function; `near` tells whether a variable is in near memory."""
    for b in f.blocks:
        _store_in_branches(f, b, near)
    for b in f.blocks:
        _load_in_branches(f, b, near)
    for b in list(f.blocks):
        _branches_for_choice(f, b, near)
    dead_code(f)


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
    if not _same(load.args[0], p):
        return None
    ones = (1 << v.type.bits) - 1
    kept, flipped = ones, 0  # the value is load & kept ^ flipped
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
    whole = sum(1 for x in phi.args if _change(x, p) is None)
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


def _load_in_branches(f: Function, b: Block, near: Near) -> None:
    """The last access of a block that goes on to two others, which alone want its value: a load in each of them."""
    at = next((k for k in range(len(b.instrs) - 1, -1, -1) if _accesses(b.instrs[k])), None)
    ways = b.instrs[-1]
    if at is None or ways.op != "br" or not ways.args or len(set(ways.blocks)) != 2:
        return
    load = b.instrs[at]
    p = _place(load, near)
    if p is None or load.op != "load":
        return
    targets = [x for x in f.blocks if x.name in ways.blocks]
    preds = predecessors(f)
    if any(preds[t.name] != [b.name] for t in targets):
        return
    users = users_of(f).get(id(load), [])
    if any(u.op == "phi" or not any(u in t.instrs for t in targets) for u in users):
        return
    if not any(_writes_bit(i, load, p, near) for t in targets for i in t.instrs):
        return
    b.instrs.remove(load)
    for t in targets:
        again = Instr("load", load.type, [p])
        again.volatile, again.line = True, load.line
        for i in t.instrs:
            i.args = [again if a is load else a for a in i.args]
        t.instrs.insert(len(list(t.phis())), again)
    for record in f.dbg_records:
        if record.value is load:
            record.value = None


def _accesses(i: Instr) -> bool:
    return i.volatile or i.op in MEMORY_BARRIERS


def _writes_bit(i: Instr, load: Instr, p: Value, near: Near) -> bool:
    """Whether a store changes one bit of what was loaded."""
    to = _place(i, near)
    if i.op != "store" or to is None or not _same(to, p):
        return False
    change = _change(i.args[0], p)
    return change is not None and change[0] is load


def _branches_for_choice(f: Function, b: Block, near: Near) -> None:
    """store (c ? change of the load : another change of it): a branch for each, until the block has no such store."""
    for store in [i for i in b.instrs if i.op == "store"]:
        p = _place(store, near)
        choice = store.args[0]
        if p is None or not isinstance(choice, Instr) or choice.op != "select":
            continue
        c, one, other = choice.args
        first, second = _change(one, p), _change(other, p)
        if first is None or second is None or first[0] is not second[0]:
            continue
        load = first[0]
        own = {id(i) for i in (load, choice, *_chain(one)[1], *_chain(other)[1])}
        if c is load or load not in b.instrs or choice not in b.instrs or not _alone(f, own, store):
            continue
        between = b.instrs[b.instrs.index(load) + 1 : b.instrs.index(store)]
        if any(_accesses(i) for i in between):
            continue
        b = _split(f, b, store, own, c, [_written(p, x, store.line) for x in (first, second)])


def _alone(f: Function, own: set[int], store: Instr) -> bool:
    """Whether only these and the store use the values of these."""
    users = users_of(f)
    return all(u is store or id(u) in own for i in own for u in users.get(i, ()))


def _split(f: Function, b: Block, store: Instr, own: set[int], c: Value, bodies: list[list[Instr]]) -> Block:
    """Cut `b` at the store, which two blocks take the place of; returns the block behind them."""
    at = b.instrs.index(store)
    end = Block(f"{b.name}.written", b.instrs[at + 1 :])
    b.instrs = [i for i in b.instrs[:at] if id(i) not in own]
    branch = new_branch("")
    branch.args, branch.line, branch.blocks = [c], store.line, []
    made: list[Block] = []
    for k, body in enumerate(bodies):
        made.append(Block(f"{b.name}.bit{k}", [*body, new_branch(end.name)]))
        branch.blocks.append(made[-1].name)
    b.instrs.append(branch)
    for x in f.blocks:
        if x.name in end.succs:
            for phi in x.phis():
                phi.blocks = [end.name if name == b.name else name for name in phi.blocks]
    place = f.blocks.index(b) + 1
    f.blocks[place:place] = [*made, end]
    for record in f.dbg_records:
        if id(record.value) in own:
            record.value = None
    return end
