"""Single-bit writes: one BSET, BCLR or BTG for every write of one bit of a volatile object in near memory.

These instructions change one bit (isa.md §5.4), so a change that an interrupt makes to another bit is not lost.
Programs rely on that for the flags of peripherals. The front end clears a bit-field before it sets it, and reads it
twice to toggle it; `one_operation` merges these. The middle end merges the writes of several
branches; this pass separates them again. It recognises:

    shape                                                       result
    one store after the branches, of a phi                      a store in each branch
    one load before the branches                                a load in each branch
    a store of a select between two values                      two branches with a load and a store each
    a store of the old value with one bit inserted              two branches likewise, selected by that bit

Needs: legal IR without critical edges. The order of volatile accesses on every path is unchanged.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from toolchain.abi.target import NEAR_END
from toolchain.ir.cfg import dead_code, new_branch, predecessors
from toolchain.ir.model import I1, VOID, Block, ConstInt, Function, GlobalRef, Instr, Value
from toolchain.optimise import bit_patterns
from toolchain.optimise.combine import users_of
from toolchain.select.state import MEMORY_BARRIERS

MAX_TREE = 24  # maximum number of operations in a stored value; a bit-field set from itself has at most 12

IsNear = Callable[[str], bool]
"""Function that returns whether the variable with a name is in near memory."""
BitChange = tuple[Instr, str, int]
"""A load, and the operation with a constant that changes one bit of its value."""


@dataclass(frozen=True)
class BitChoice:
    """A value that is one change of a load if `condition` has a bit of `mask`, and another change of it otherwise."""

    condition: Value
    mask: int
    first: BitChange
    second: BitChange
    own: frozenset[int]  # ids of the load, and of the instructions that compute the value


def run(f: Function, is_near: IsNear) -> None:
    """Separate the single-bit writes of the function."""
    one_operation(f)
    for b in f.blocks:
        _store_in_branches(f, b, is_near)
    addresses = _single_bit_addresses(f, is_near)
    for b in f.blocks if addresses else ():
        _load_in_branches(f, b, is_near, addresses)
    branches_for_choices(f, is_near)


def branches_for_choices(f: Function, is_near: IsNear) -> None:
    """Replace every store that chooses between two values of one bit by two branches with one instruction each."""
    for b in list(f.blocks):
        _branches_for_choice(f, b, is_near)
    dead_code(f)


def one_operation(f: Function) -> None:
    """Merge the operations that together change one bit of a volatile object, in any memory.

    A bit-field that is written with a function of itself (`x.bit ^= 1`, `x.bit = !x.bit`) is read twice by the
    front end; the instruction that changes the bit reads it once.
    """
    users = users_of(f)
    for b in f.blocks:
        for store in [i for i in b.instrs if i.op == "store" and i.volatile]:
            tree = _tree_of(b, store, users)
            change = bit_patterns.single_change(store.args[0], tree.loads) if tree is not None else None
            if tree is None or change is None:
                continue
            op, k = change
            value, old = tree.steps[-1], tree.loads[-1]
            if len(tree.steps) == 1 and len(tree.loads) == 1:
                continue
            for load in tree.loads[:-1]:
                b.instrs.remove(load)
            b.instrs.remove(value)
            value.op, value.extra, value.args = op, {}, [old, ConstInt(old.type, k)]
            b.instrs.insert(b.instrs.index(store), value)
            _forget(f, {id(i) for i in (*tree.loads[:-1], *tree.steps[:-1])})
    dead_code(f)


@dataclass(frozen=True)
class ValueTree:
    """The loads of the stored object and the operations, in order, that compute only the value of a store."""

    loads: list[Instr]
    steps: list[Instr]


def _tree_of(b: Block, store: Instr, users: dict[int, list[Instr]]) -> ValueTree | None:
    """The tree of a store whose operands are constants and loads of the same object, without accesses in between."""
    inside: dict[int, Instr] = {}
    work = [store.args[0]]
    while work:
        v = work.pop()
        if isinstance(v, Instr) and id(v) not in inside:
            if len(inside) == MAX_TREE or not (v.op in bit_patterns.OPERATIONS or v.op == "load"):
                return None
            inside[id(v)] = v
            work += v.args if v.op != "load" else []
    found = [i for i in b.instrs if id(i) in inside]
    loads = [i for i in found if i.op == "load"]
    if not loads or len(found) != len(inside) or found[-1] is not store.args[0]:
        return None
    for load in loads:
        if not load.volatile or load.type is not store.args[0].type or not _same(load.args[0], store.args[1]):
            return None
    if any(u is not store and id(u) not in inside for i in found for u in users.get(id(i), ())):
        return None
    between = b.instrs[b.instrs.index(loads[0]) : b.instrs.index(store)]
    if any(_accesses(i) or i.op == "load" for i in between if i not in loads):
        return None
    return ValueTree(loads, [i for i in found if i.op != "load"])


def _forget(f: Function, removed: set[int]) -> None:
    """Remove the values of debug records that are no longer computed."""
    for record in f.dbg_records:
        if id(record.value) in removed:
            record.value = None


def _single_bit_addresses(f: Function, is_near: IsNear) -> list[Value]:
    """Addresses of the single-bit writes of the function."""
    stores = [(i, _near_address(i, is_near)) for b in f.blocks for i in b.instrs if i.op == "store"]
    return [p for i, p in stores if p is not None and _writes_single_bit(i.args[0], p)]


def _near_address(i: Instr, is_near: IsNear) -> Value | None:
    """Address of a volatile access of a byte or word, if it is a constant in near memory."""
    if i.op not in ("load", "store") or not i.volatile:
        return None
    t, p = (i.type if i.op == "load" else i.args[0].type), i.args[-1]
    if t.bits not in (8, 16):
        return None
    if isinstance(p, ConstInt):
        return p if p.value < NEAR_END else None
    return p if isinstance(p, GlobalRef) and is_near(p.name) else None


def _same(p: Value, q: Value) -> bool:
    """Whether two constant addresses are equal."""
    if p is q:
        return True
    if isinstance(p, GlobalRef) and isinstance(q, GlobalRef):
        return (p.name, p.offset) == (q.name, q.offset)
    return isinstance(p, ConstInt) and isinstance(q, ConstInt) and p.value == q.value


def _chain(v: Value) -> tuple[Value, list[Instr]]:
    """The first operand of a chain of logical operations with constants, and the operations in order."""
    steps: list[Instr] = []
    while isinstance(v, Instr) and v.op in ("and", "or", "xor") and isinstance(v.args[1], ConstInt):
        steps.insert(0, v)
        v = v.args[0]
    return v, steps


def _change(v: Value, p: Value) -> BitChange | None:
    """Return the BitChange if `v` is the volatile object at `p` with one bit changed, else None."""
    load, steps = _chain(v)
    if not isinstance(load, Instr) or load.op != "load" or not load.volatile or load.type is not v.type:
        return None
    return _one_bit(load, (1 << v.type.bits) - 1, 0, steps) if _same(load.args[0], p) else None


def _one_bit(load: Instr, kept: int, flipped: int, steps: list[Instr]) -> BitChange | None:
    """Return the BitChange of `steps`, applied to load & kept ^ flipped; None unless they change exactly one bit."""
    ones = (1 << load.type.bits) - 1
    for step in steps:
        k = _constant(step)
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


def _constant(step: Instr) -> int:
    """The constant operand of a step of `_chain`."""
    k = step.args[1]
    assert isinstance(k, ConstInt)
    return k.value


def _choice(v: Value, p: Value) -> BitChoice | None:
    """Return the BitChoice if `v` selects between two changes of one bit of the object at `p`, else None."""
    root, steps = _chain(v)
    if not isinstance(root, Instr) or len(root.args) < 2:
        return None
    if root.op == "select" and not steps:
        condition, one, other = root.args
        first, second = _change(one, p), _change(other, p)
        inner, mask = [*_chain(one)[1], *_chain(other)[1]], 1
    elif root.op == "or":
        kept, condition = root.args if _change(root.args[0], p) is not None else reversed(root.args)
        cleared = _change(kept, p)
        if cleared is None or cleared[1] != "and":
            return None
        load, _, rest = cleared
        mask = ~rest & (1 << v.type.bits) - 1
        if _possible_bits(condition) != mask:
            return None
        first, second = _one_bit(load, rest, mask, steps), _one_bit(load, rest, 0, steps)
        inner = [*_chain(kept)[1], *steps]
    else:
        return None
    if first is None or second is None or first[0] is not second[0] or condition is first[0]:
        return None
    return BitChoice(condition, mask, first, second, frozenset(id(i) for i in (first[0], root, *inner)))


def _possible_bits(v: Value) -> int:
    """Mask of the bits of a value that may be 1."""
    ones = (1 << v.type.bits) - 1
    if isinstance(v, ConstInt):
        return v.value & ones
    if not isinstance(v, Instr):
        return ones
    by = v.args[1].value if len(v.args) == 2 and isinstance(v.args[1], ConstInt) else None
    if v.op == "and":
        return _possible_bits(v.args[0]) & _possible_bits(v.args[1])
    if v.op == "shl" and by is not None:
        return _possible_bits(v.args[0]) << by & ones
    if v.op == "lshr" and by is not None:
        return _possible_bits(v.args[0]) >> by
    if v.op in ("zext", "trunc"):
        return _possible_bits(v.args[0]) & ones
    return ones


def _truth(v: Value, mask: int, made: list[Instr]) -> Value:
    """Build an i1: whether a value has a bit of `mask`; the instructions that compute it are appended to `made`."""
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


def _writes_single_bit(v: Value, p: Value) -> bool:
    """Whether storing the value to `p` is a single-bit change or a select between two of them."""
    return _change(v, p) is not None or _choice(v, p) is not None


def _read_modify_write(p: Value, change: BitChange, line: str | None) -> list[Instr]:
    """Load, operation and store of a change at `p`."""
    old, op, k = change
    load = Instr("load", old.type, [p])
    new = Instr(op, old.type, [load, ConstInt(old.type, k)])
    store = Instr("store", VOID, [new, p])
    load.volatile = store.volatile = True
    load.line, new.line, store.line = old.line, line, line
    return [load, new, store]


def _store_in_branches(f: Function, b: Block, is_near: IsNear) -> None:
    """Replace a store of a phi at the start of a block by a store at the end of each predecessor.

    The predecessors must have no other successor, and all but one of the values must be single-bit changes."""
    phis = list(b.phis())
    store = b.instrs[len(phis)]
    p, v = _near_address(store, is_near), store.args[0] if store.args else None
    phi = next((i for i in phis if i is v), None)
    if p is None or phi is None or store.op != "store" or len(users_of(f)[id(phi)]) != 1:
        return
    blocks = {x.name: x for x in f.blocks}
    sources = [blocks[name] for name in phi.blocks]
    if sorted(phi.blocks) != sorted(predecessors(f)[b.name]):
        return
    if any(s.instrs[-1].op != "br" or s.instrs[-1].args for s in sources):
        return
    whole = sum(1 for x in phi.args if not _writes_single_bit(x, p))
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
        _store_in_branches(f, s, is_near)


def _load_in_branches(f: Function, b: Block, is_near: IsNear, addresses: list[Value]) -> None:
    """Replace a load before a two-way branch by a load in each branch.

    The load must be the last memory access of its block. Its uses must be in code reached only through the branches.
    Blocks without an access between branch and use are allowed, because a switch is a tree of such blocks.
    """
    load = _last_access_before_branch(b)
    p = _near_address(load, is_near) if load is not None and load.op == "load" else None
    if load is None or p is None or not any(_same(p, q) for q in addresses):
        return
    targets = [x for x in f.blocks if x.name in b.instrs[-1].blocks]
    preds = predecessors(f)
    if any(preds[t.name] != [b.name] for t in targets):
        return
    regions = [_region_without_access(f, t, preds) for t in targets]
    if not _used_only_inside(f, load, regions):
        return
    if not any(_changes_loaded_bit(i, load, p, is_near) for region in regions for x in region for i in x.instrs):
        return
    b.instrs.remove(load)
    for t, region in zip(targets, regions, strict=True):
        _insert_copy(load, p, t, region)
    for record in f.dbg_records:
        if record.value is load:
            record.value = None
    for t in targets:
        _load_in_branches(f, t, is_near, addresses)


def _last_access_before_branch(b: Block) -> Instr | None:
    """The last memory access of a block that ends in a branch to two different blocks."""
    branch = b.instrs[-1]
    if branch.op != "br" or not branch.args or len(set(branch.blocks)) != 2:
        return None
    return next((i for i in reversed(b.instrs) if _accesses(i)), None)


def _region_without_access(f: Function, t: Block, preds: dict[str, list[str]]) -> list[Block]:
    """`t`, and the blocks that are reached only from `t`, without a memory access in between."""
    found = [t]
    for x in found:
        if not any(_accesses(i) for i in x.instrs):
            found += [y for y in f.blocks if y.name in x.succs and preds[y.name] == [x.name]]
    return found


def _used_only_inside(f: Function, load: Instr, regions: list[list[Block]]) -> bool:
    """Whether all users of a load lie in the regions and none is a phi."""
    inside = {id(i) for region in regions for x in region for i in x.instrs}
    return all(u.op != "phi" and id(u) in inside for u in users_of(f).get(id(load), []))


def _insert_copy(load: Instr, p: Value, t: Block, region: list[Block]) -> None:
    """Insert a copy of a load at the start of `t`, and use it in the region."""
    copy = Instr("load", load.type, [p])
    copy.volatile, copy.line = True, load.line
    for i in (i for x in region for i in x.instrs):
        i.args = [copy if a is load else a for a in i.args]
    t.instrs.insert(len(list(t.phis())), copy)


def _accesses(i: Instr) -> bool:
    """Whether an instruction may access memory, other than a plain load."""
    return i.volatile or i.op in MEMORY_BARRIERS


def _changes_loaded_bit(i: Instr, load: Instr, p: Value, is_near: IsNear) -> bool:
    """Whether an instruction stores the value of `load` to `p` with one bit changed."""
    target = _near_address(i, is_near)
    if i.op != "store" or target is None or not _same(target, p):
        return False
    change, choice = _change(i.args[0], p), _choice(i.args[0], p)
    return (change or (choice.first if choice is not None else (None,)))[0] is load


def _branches_for_choice(f: Function, b: Block, is_near: IsNear) -> None:
    """Replace every store of a choice between two changes by two branches, each with a load and a store."""
    for store in [i for i in b.instrs if i.op == "store"]:
        p = _near_address(store, is_near)
        choice = _choice(store.args[0], p) if p is not None else None
        if p is None or choice is None:
            continue
        load, value = choice.first[0], store.args[0]
        if load not in b.instrs or value not in b.instrs or not _used_only_by(f, choice.own, store):
            continue
        between = b.instrs[b.instrs.index(load) + 1 : b.instrs.index(store)]
        if any(_accesses(i) for i in between):
            continue
        b = _split(f, b, store, choice, [_read_modify_write(p, x, store.line) for x in (choice.first, choice.second)])


def _used_only_by(f: Function, own: frozenset[int], store: Instr) -> bool:
    """Whether the instructions `own` have no users except each other and the store."""
    users = users_of(f)
    return all(u is store or id(u) in own for i in own for u in users.get(i, ()))


def _split(f: Function, b: Block, store: Instr, choice: BitChoice, bodies: list[list[Instr]]) -> Block:
    """Replace a store by a branch to one of two blocks with `bodies`; return the block after them."""
    at = b.instrs.index(store)
    end = Block(f"{b.name}.written", b.instrs[at + 1 :])
    b.instrs = [i for i in b.instrs[:at] if id(i) not in choice.own]
    test: list[Instr] = []
    branch = new_branch("")
    branch.args, branch.line, branch.blocks = [_truth(choice.condition, choice.mask, test)], store.line, []
    made: list[Block] = []
    for k, body in enumerate(bodies):
        made.append(Block(f"{b.name}.bit{k}", [*body, new_branch(end.name)]))
        branch.blocks.append(made[-1].name)
    b.instrs += [*test, branch]
    for x in f.blocks:
        if x.name in end.succs:
            for phi in x.phis():
                phi.blocks = [end.name if name == b.name else name for name in phi.blocks]
    at = f.blocks.index(b) + 1
    f.blocks[at:at] = [*made, end]
    _forget(f, set(choice.own))
    return end
