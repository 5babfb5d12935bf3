"""Induction variables: strength reduction of array indices, and loop counters that count down to zero.

    a[i] with i += c    ->  a pointer stepped by c elements, which becomes [Wn++]
    i == n as the exit  ->  n - i == 0, tested by the flags of the decrement
    i == max(n, start)  ->  i >= n: the middle end's trip count of `i < n`

Needs: legal IR. Only loops with one entry are changed. The middle end runs no loop strength reduction (engines.md §5).
"""

from __future__ import annotations

from dataclasses import dataclass, field

from toolchain.ir.build import IrBuilder, const
from toolchain.ir.cfg import dead_code, natural_loops, predecessors
from toolchain.ir.model import I16, Block, ConstInt, Function, Instr, Value

MAX_POINTERS = 3
MAX_HEADER_PHIS = 6  # maximum number of loop-carried values; with more, a register would be spilled
CALLS = frozenset(("call", "asm", "builtin"))


@dataclass
class CountedLoop:
    """A loop with one entry block."""

    f: Function
    header: Block
    entry: Block
    body: list[Block]
    inside: set[int] = field(default_factory=set)  # ids of the instructions in the loop

    def invariant(self, v: Value) -> bool:
        """Whether a value is the same in every iteration."""
        return id(v) not in self.inside


@dataclass
class InductionVariable:
    """A phi in the header that increases by a constant per iteration: `step` = `phi` + amount in the body."""

    phi: Instr
    step: Instr
    start: Value
    amount: int


def run(f: Function) -> None:
    """Rewrite the loops of the function: pointers in innermost loops without calls, counters in all loops."""
    for loop, innermost in _loops(f):
        if innermost and not any(i.op in CALLS for b in loop.body for i in b.instrs):
            for counter in _counters(loop):
                _make_pointers(loop, counter)
    dead_code(f)
    uses = UseIndex(f)
    for loop, _ in _loops(f):
        for counter in _counters(loop):
            _unclamp(loop, counter, uses)
            _count_down(loop, counter, uses)
    dead_code(f)


class UseIndex:
    """Users of every value of a function, once per operand; rewrites change operands through it."""

    def __init__(self, f: Function) -> None:
        self._users: dict[int, list[Instr]] = {}
        for b in f.blocks:
            for i in b.instrs:
                self.add(i)

    def of(self, v: Value) -> list[Instr]:
        """Return the instructions that use a value."""
        return self._users.get(id(v), [])

    def add(self, i: Instr) -> None:
        """Add a new instruction."""
        for a in i.args:
            self._users.setdefault(id(a), []).append(i)

    def set_args(self, i: Instr, args: list[Value]) -> None:
        """Replace the operands of an instruction."""
        for a in i.args:
            self._users[id(a)].remove(i)
        i.args = args
        self.add(i)


def _loops(f: Function) -> list[tuple[CountedLoop, bool]]:
    """Return the natural loops with one entering block, each with whether it is innermost."""
    blocks = {b.name: b for b in f.blocks}
    preds = predecessors(f)
    loops = natural_loops({b.name: b.succs for b in f.blocks}, f.blocks[0].name)
    found = []
    for header, names in loops.items():
        outside = [p for p in preds[header] if p not in names]
        if len(outside) != 1 or blocks[outside[0]].instrs[-1].op == "indirectbr":
            continue
        body = [b for b in f.blocks if b.name in names]
        inside = {id(i) for b in body for i in b.instrs}
        innermost = not any(other != header and other in names for other in loops)
        found.append((CountedLoop(f, blocks[header], blocks[outside[0]], body, inside), innermost))
    return found


def _counters(loop: CountedLoop) -> list[InductionVariable]:
    return [c for phi in loop.header.phis() if (c := _counter(loop, phi)) is not None]


def _counter(loop: CountedLoop, phi: Instr) -> InductionVariable | None:
    """The induction variable of a phi; None for other phis."""
    if phi.type is not I16:
        return None
    start: Value | None = None
    step: Value | None = None
    for v, name in zip(phi.args, phi.blocks, strict=True):
        if name == loop.entry.name:
            start = v
        elif step is None or step is v:
            step = v
        else:
            return None
    if not isinstance(step, Instr) or start is None or step.op != "add" or step.args[0] is not phi:
        return None
    amount = step.args[1]
    if not isinstance(amount, ConstInt) or loop.invariant(step):
        return None
    return InductionVariable(phi, step, start, amount.signed)


def _users(f: Function, v: Value) -> list[Instr]:
    """Instructions that use a value, once per operand."""
    return [i for b in f.blocks for i in b.instrs for a in i.args if a is v]


# ---------------------------------------------------------------------------------------------------------------------
# pointers


def _make_pointers(loop: CountedLoop, counter: InductionVariable) -> None:
    """Create a pointer for every pair of base and scale."""
    groups: dict[tuple[str, int], list[tuple[Instr, Value, int]]] = {}
    for b in loop.body:
        for i in b.instrs:
            found = _scaled_sum(loop, counter, i)
            if found is not None:
                base, scale, ahead = found
                groups.setdefault((_identity(base), scale), []).append((i, base, ahead))
    room = MAX_HEADER_PHIS - sum(1 for _ in loop.header.phis())
    for (_, scale), sums in list(groups.items())[: max(0, min(MAX_POINTERS, room))]:
        _make_pointer(loop, counter, scale, sums)


def _identity(base: Value) -> str:
    return repr(base) if not isinstance(base, Instr) else f"instr {id(base)}"


def _scaled_sum(loop: CountedLoop, counter: InductionVariable, i: Instr) -> tuple[Value, int, int] | None:
    """(base, scale of the counter, constant offset) of an address base + (+-counter + n) * scale; else None."""
    if i.op != "add" or i.type is not I16:
        return None
    for base, scaled in ((i.args[0], i.args[1]), (i.args[1], i.args[0])):
        if isinstance(base, ConstInt) or not loop.invariant(base) or not isinstance(scaled, Instr):
            continue
        factor = scaled.args[1] if len(scaled.args) == 2 else None
        if scaled.op not in ("shl", "mul") or not isinstance(factor, ConstInt):
            continue
        scale = 1 << factor.value if scaled.op == "shl" else factor.signed
        linear = _linear(counter, scaled.args[0])
        if linear is not None:
            return base, scale * linear[0], scale * linear[1]
    return None


def _linear(counter: InductionVariable, index: Value) -> tuple[int, int] | None:
    """(1, n) for an index counter + n, (-1, n) for n - counter, None for any other."""
    if index is counter.phi:
        return 1, 0
    if not isinstance(index, Instr) or index.op not in ("add", "sub", "xor"):
        return None
    a, b = index.args
    if index.op == "sub" and b is counter.phi and isinstance(a, ConstInt):
        return -1, a.signed
    if a is counter.phi and isinstance(b, ConstInt) and index.op == "add":
        return 1, b.signed
    return (-1, -1) if a is counter.phi and isinstance(b, ConstInt) and b.signed == -1 and index.op == "xor" else None


def _make_pointer(
    loop: CountedLoop, counter: InductionVariable, scale: int, sums: list[tuple[Instr, Value, int]]
) -> None:
    """Add a pointer phi to the loop, and replace the addresses `sums` by it."""
    base = sums[0][1]
    last = loop.entry.instrs.pop()
    b = IrBuilder(loop.entry)
    b.line = last.line
    start = b.binary("add", base, b.binary("mul", counter.start, const(I16, scale)))
    loop.entry.instrs.append(last)
    pointer = Instr("phi", I16, [])
    step = Instr("add", I16, [pointer, const(I16, counter.amount * scale)])
    step.line = counter.step.line
    for name in counter.phi.blocks:
        pointer.args.append(start if name == loop.entry.name else step)
        pointer.blocks.append(name)
    loop.header.instrs.insert(0, pointer)
    home = next(block for block in loop.body if counter.step in block.instrs)
    stride = counter.amount * scale
    early = next((i for i, _, ahead in sums if stride < 0 and ahead == stride and i in home.instrs), None)
    if early is not None and any(i is not early and _follows(loop, home, early, i) for i, _, _ in sums):
        early = None  # the pointer before the step is still used after it, which would cost a copy
    if early is not None:  # counting downwards, the address is the stepped pointer: [--Wn]
        home.instrs.insert(home.instrs.index(early), step)
    else:
        home.instrs.insert(home.instrs.index(counter.step) + 1, step)
    loop.inside |= {id(pointer), id(step)}
    for i, _, ahead in sums:
        if i is early:
            _replace(loop.f, i, step)
        elif ahead:
            i.args = [pointer, const(I16, ahead)]
        else:
            _replace(loop.f, i, pointer)


def _follows(loop: CountedLoop, home: Block, early: Instr, i: Instr) -> bool:
    """Whether the address `i` is used in the loop after instruction `early` of block `home`, or in another block."""
    behind = home.instrs[home.instrs.index(early) :]
    return any(u in behind for u in _users(loop.f, i)) or any(
        u in b.instrs for u in _users(loop.f, i) for b in loop.body if b is not home
    )


def _replace(f: Function, old: Instr, new: Instr) -> None:
    """Replace all uses of a value."""
    for user in _users(f, old):
        user.args = [new if a is old else a for a in user.args]


# ---------------------------------------------------------------------------------------------------------------------
# counting down


def _leaves_at(loop: CountedLoop, test: Instr) -> bool:
    """Whether the header tests the counter and exits the loop, so that the counter never passes 0."""
    br = loop.header.instrs[-1]
    if br.op != "br" or not br.args or br.args[0] is not test:
        return False
    return br.blocks[0 if test.pred in ("eq", "sge") else 1] not in {b.name for b in loop.body}


def _unclamped(v: Value, start: Value) -> Value | None:
    """The n of a value that is the signed max(n, start) for a constant start; None for other values."""
    if not isinstance(v, Instr) or v.op != "select" or not isinstance(v.args[0], Instr) or v.args[0].op != "icmp":
        return None
    test, a, b = v.args
    assert isinstance(test, Instr)
    n, least = (a, b) if test.pred in ("sgt", "sge") else (b, a)
    if test.pred not in ("sgt", "sge", "slt", "sle") or not all(_equal(x, start) for x in (least, test.args[1])):
        return None
    return n if test.args[0] is n else None


def _equal(a: Value, b: Value) -> bool:
    return isinstance(a, ConstInt) and isinstance(b, ConstInt) and a.value == b.value


def _unclamp(loop: CountedLoop, counter: InductionVariable, uses: UseIndex) -> None:
    """Replace the exit test i == max(n, start) of a loop in steps of one from `start` by i >= n."""
    test = _exit_test(loop, uses)
    if counter.amount != 1 or test is None or test.args[0] is not counter.phi or not _leaves_at(loop, test):
        return
    n = _unclamped(test.args[1], counter.start)
    if n is not None:
        uses.set_args(test, [counter.phi, n])
        test.extra["pred"] = "sge" if test.pred == "eq" else "slt"


def _exit_test(loop: CountedLoop, uses: UseIndex) -> Instr | None:
    """The comparison for equality that only the branch at the end of the header uses, or None."""
    br = loop.header.instrs[-1]
    test = br.args[0] if br.op == "br" and br.args else None
    if not isinstance(test, Instr) or test.op != "icmp" or test.pred not in ("eq", "ne"):
        return None
    return test if len(uses.of(test)) == 1 else None


def _count_down(loop: CountedLoop, counter: InductionVariable, uses: UseIndex) -> None:
    """Let a counter that only the exit test uses count down to zero."""
    if counter.amount != 1:
        return
    tests = {id(u): u for v in (counter.phi, counter.step) for u in uses.of(v)}
    tests.pop(id(counter.step), None)
    tests.pop(id(counter.phi), None)
    if len(tests) != 1:
        return
    test = next(iter(tests.values()))
    if test.op != "icmp" or test.args[0] not in (counter.phi, counter.step):
        return
    if test.pred in ("sge", "slt"):
        _count_down_signed(loop, counter, test, uses)
        return
    if test.pred not in ("eq", "ne"):
        return
    limit = test.args[1]
    if not loop.invariant(limit) or limit.type is not I16:
        return
    last = loop.entry.instrs.pop()
    b = IrBuilder(loop.entry)
    b.line = last.line
    before = len(loop.entry.instrs)
    distance = b.binary("sub", limit, counter.start)
    for made in loop.entry.instrs[before:]:
        uses.add(made)
    loop.entry.instrs.append(last)
    _start_at(loop, counter, distance, uses)
    uses.set_args(test, [test.args[0], const(I16, 0)])


def _count_down_signed(loop: CountedLoop, counter: InductionVariable, test: Instr, uses: UseIndex) -> None:
    """Let a counter that starts at 0 or 1, with the exit test i >= n, count down from n; n - i could overflow."""
    n, start = test.args[1], counter.start
    if test.args[0] is not counter.phi or not _leaves_at(loop, test) or not loop.invariant(n):
        return
    if isinstance(start, ConstInt) and start.value in (0, 1):
        _start_at(loop, counter, n, uses)
        uses.set_args(test, [counter.phi, start])
        test.extra["pred"] = "sle" if test.pred == "sge" else "sgt"


def _start_at(loop: CountedLoop, counter: InductionVariable, start: Value, uses: UseIndex) -> None:
    """Let the counter start at `start` and count down."""
    phi = counter.phi
    uses.set_args(phi, [start if n == loop.entry.name else v for v, n in zip(phi.args, phi.blocks, strict=True)])
    uses.set_args(counter.step, [phi, const(I16, -1)])
    for record in loop.f.dbg_records:
        if record.value is counter.phi or record.value is counter.step:
            record.value = None  # the source variable counts up, so its value is unknown
