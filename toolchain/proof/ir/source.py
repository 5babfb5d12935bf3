"""Optimised LLVM IR on symbolic inputs: one path after the other, with what the world sees of each.

What would be undefined becomes an assumption of its path. The reader keeps no `nsw`, `nuw` or `exact`, so sums wrap
here as they do in the machine: what is proved holds for more inputs than the IR promises.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Set
from typing import Any, Final

import z3

from toolchain.abi.target import SFR_END
from toolchain.ir.model import (
    Block,
    ConstInt,
    Function,
    GlobalRef,
    InlineAsm,
    Instr,
    ParameterAttributes,
    Type,
    Value,
    size_of,
    store_size,
    struct_offsets,
)
from toolchain.proof.asm_statements import Shape, plain, shape_of
from toolchain.proof.ir import floats
from toolchain.proof.ir.intrinsics import INTRINSICS, base_of
from toolchain.proof.ir.operands import SUMS, Operands, Symbolic, either
from toolchain.proof.memory import Frame
from toolchain.proof.path import Event, Path
from toolchain.proof.solver import Undecided, feasible
from toolchain.proof.terms import Term, known, one_bit, truth, vector

MOST_VISITS: Final = 70
"""Rounds of a loop that are followed on one path,"""
MOST_FORKS: Final = 4
"""and how many of them may end there or not, as the input says."""
MOST_PATHS: Final = 400
COMPARISONS: Final[dict[str, Callable[[Term, Term], Term]]] = {
    "eq": lambda a, b: a == b, "ne": lambda a, b: a != b, "ugt": z3.UGT, "uge": z3.UGE, "ult": z3.ULT, "ule": z3.ULE,
    "sgt": lambda a, b: a > b, "sge": lambda a, b: a >= b, "slt": lambda a, b: a < b, "sle": lambda a, b: a <= b,
}  # fmt: skip
SHIFTS: Final[dict[str, Callable[[Term, Term], Term]]] = {
    "shl": lambda a, b: a << b, "lshr": z3.LShR, "ashr": lambda a, b: a >> b,
}  # fmt: skip
QUOTIENTS: Final[dict[str, Callable[[Term, Term], Term]]] = {
    "udiv": z3.UDiv, "sdiv": lambda a, b: a / b, "urem": z3.URem, "srem": z3.SRem,
}  # fmt: skip


class Evaluator(Operands):
    """Follows one function. `address` gives a global's place, `frame` says where its variables lie."""

    def __init__(
        self, function: Function, frame: Frame, address: Callable[[str], int], watched: Set[str] = frozenset()
    ) -> None:
        """`watched`: blocks whose values paths remember (`Path.heads`)."""
        super().__init__(address)
        self.watched: Final = watched
        self.function: Final = function
        self.frame: Final = frame
        self.blocks: Final = {b.name: b for b in function.blocks}
        self._slots = {i.name: i for b in function.blocks for i in b.instrs if i.op == "alloca"}

    def paths(self, start: Path, first: str = "", heads: Set[str] = frozenset(), most: int = 0) -> Iterator[Path]:
        """Every path that some input takes, from the block `first`, whose phis have values, or the beginning, up to the
        end or one of `heads`. Raises Undecided; with `most`, paths that decide more often whether to go round a loop
        again are left out."""
        work: list[tuple[Path, Block, str]] = [(start, self.blocks[first or self.function.blocks[0].name], "")]
        ended = 0
        while work:
            path, block, came = work.pop()
            while True:
                if came:
                    self._enter(path, block, came)
                    if block.name in heads:
                        path.part(barrier=False)
                        path.ended, path.head = "loop", block.name
                        yield path
                        break
                following = self._block(path, block)
                if not following:
                    ended += 1
                    if ended > MOST_PATHS:
                        raise Undecided(f"more than {MOST_PATHS} ways through it")
                    yield path
                    break
                possible = (
                    following if len(following) == 1 else [(c, n) for c, n in following if feasible([*path.known, c])]
                )
                if not possible:
                    break
                came = block.name
                if len(possible) > 1:
                    path.forks[came] = path.forks.get(came, 0) + 1
                    if most and path.forks[came] > most:
                        break
                    if path.forks[came] > MOST_FORKS:
                        raise Undecided("a loop whose rounds are not known")
                for condition, name in possible[1:]:
                    other = path.copy()
                    other.taken.append(condition)
                    work.append((other, self.blocks[name], came))
                condition, name = possible[0]
                if len(following) > 1:
                    path.taken.append(condition)
                block = self.blocks[name]

    # -- a block -----------------------------------------------------------------------------------------------------

    def _enter(self, path: Path, block: Block, came: str) -> None:
        """By the edge from another block."""
        entered = [(phi, self.value(path, phi.args[phi.blocks.index(came)])) for phi in block.phis()]
        for phi, value in entered:
            path.values[id(phi)] = value

    def _block(self, path: Path, block: Block) -> list[tuple[Term, str]]:
        """Run it; where it goes on, by condition."""
        path.visits[block.name] = path.visits.get(block.name, 0) + 1
        if path.visits[block.name] > MOST_VISITS:
            raise Undecided("a loop whose rounds are not known")
        if block.name in self.watched:
            path.heads.append((block.name, dict(path.values), len(path.events)))
        for i in block.instrs:
            if i.op == "phi":
                continue
            if i.op in ("br", "switch", "ret", "unreachable", "indirectbr"):
                return self._leave(path, i)
            found = self._instruction(path, i)
            if found is not None:
                path.values[id(i)] = found
        raise Undecided("a block without an end")

    def _leave(self, path: Path, i: Instr) -> list[tuple[Term, str]]:
        if i.op in ("ret", "unreachable"):
            path.part(barrier=False)
        if i.op == "ret":
            path.result, path.ended = (self.value(path, i.args[0]) if i.args else None), "ret"
            return []
        if i.op == "unreachable":
            path.ended = "unreachable"
            return []
        if i.op == "indirectbr":
            raise Undecided("a computed goto")
        if not i.args:
            return [(z3.BoolVal(True), i.blocks[0])]
        term = self.sure(path, i.args[0])
        if i.op == "br":
            if i.blocks[0] == i.blocks[1]:
                return [(z3.BoolVal(True), i.blocks[0])]
            place = known(term)
            if place is not None:
                return [(z3.BoolVal(True), i.blocks[0 if place else 1])]
            return [(truth(term), i.blocks[0]), (z3.Not(truth(term)), i.blocks[1])]
        cases = i.extra["cases"]
        assert isinstance(cases, list)
        out: dict[str, list[Term]] = {}
        for case, name in zip(cases, i.blocks[1:], strict=True):
            out.setdefault(name, []).append(term == vector(case, term.size()))
        rest = z3.And(*(term != vector(case, term.size()) for case in cases)) if cases else z3.BoolVal(True)
        out.setdefault(i.blocks[0], []).append(rest)
        return [(z3.Or(*conditions), name) for name, conditions in out.items()]

    # -- instructions ------------------------------------------------------------------------------------------------

    def again(self, path: Path, i: Instr) -> None:
        """An instruction that ran before, on a path that begins later."""
        if i.type.kind == "void":
            return
        callee = i.args[-1] if i.op == "call" else None
        computed = isinstance(callee, GlobalRef) and callee.name.startswith("llvm.")
        if i.op in ("load", "call", "phi", "freeze") and not computed:
            path.values[id(i)] = self.of_type(i.type, lambda t: (self.unknown("before", t.bits), None))
        else:
            path.values[id(i)] = self._instruction(path, i)

    def _instruction(self, path: Path, i: Instr) -> Any:
        if i.op in SUMS | SHIFTS | QUOTIENTS:
            return self._binary(path, i)
        if i.op in floats.SUMS:
            (a, p), (b, q) = self.scalar(path, i.args[0]), self.scalar(path, i.args[1])
            return floats.arithmetic(i.op, a, b), either(p, q)
        handler = _HANDLERS.get(i.op)
        if handler is None:
            if i.op in ("sitofp", "uitofp", "fptosi", "fptoui", "fpext", "fptrunc"):
                a, p = self.scalar(path, i.args[0])
                return floats.converted(i.op, a, i.type.bits), p
            if i.op in ("zext", "sext", "trunc", "ptrtoint", "inttoptr", "bitcast", "addrspacecast", "ptrtoaddr"):
                return self.cast(i.op, self.scalar(path, i.args[0]), i.type)
            raise Undecided(f"the instruction {i.op}")
        return handler(self, path, i)

    def _binary(self, path: Path, i: Instr) -> Symbolic:
        (a, p), (b, q) = self.scalar(path, i.args[0]), self.scalar(path, i.args[1])
        poison = either(p, q)
        if i.op in QUOTIENTS:
            b = self.sure(path, i.args[1])
            path.assumed.append(b != 0)
            if i.op in ("sdiv", "srem"):
                least = vector(1 << i.type.bits - 1, i.type.bits)
                path.assumed.append(z3.Not(z3.And(a == least, b == vector(-1, i.type.bits))))
            return QUOTIENTS[i.op](a, b), poison
        if i.op in SHIFTS:
            amount = known(b)
            if amount is None:
                poison = either(poison, z3.UGE(b, vector(i.type.bits, i.type.bits)))
            elif amount >= i.type.bits:
                poison = z3.BoolVal(True)
            return SHIFTS[i.op](a, b), poison
        return SUMS[i.op](a, b), poison

    def _compare(self, path: Path, i: Instr) -> Symbolic:
        (a, p), (b, q) = self.scalar(path, i.args[0]), self.scalar(path, i.args[1])
        if i.op == "fcmp":
            return floats.compared(i.pred, a, b), either(p, q)
        return one_bit(COMPARISONS[i.pred](a, b)), either(p, q)

    def _negated(self, path: Path, i: Instr) -> Symbolic:
        term, poison = self.scalar(path, i.args[0])
        return term ^ vector(1 << i.type.bits - 1, i.type.bits), poison

    def _select(self, path: Path, i: Instr) -> Any:
        c, poison = self.scalar(path, i.args[0])
        place = known(c)
        a, b = self.value(path, i.args[1]), self.value(path, i.args[2])
        if place is not None:
            return a if place else b
        if isinstance(a, list):
            raise Undecided("a choice of aggregates")
        mixed = None
        if a[1] is not None or b[1] is not None:
            false = z3.BoolVal(False)
            mixed = z3.If(truth(c), false if a[1] is None else a[1], false if b[1] is None else b[1])
        return z3.If(truth(c), a[0], b[0]), either(poison, mixed)

    def _freeze(self, path: Path, i: Instr) -> Any:
        term, poison = self.scalar(path, i.args[0])
        if poison is not None and feasible([*path.known, poison]):
            raise Undecided("freeze of what may be undefined")
        return term, None

    def _alloca(self, path: Path, i: Instr) -> Symbolic:
        if i.name not in self.frame.objects:
            raise Undecided("a variable without a place in the frame")
        return vector(self.frame.objects[i.name][0], 16), None

    def _address(self, path: Path, i: Instr) -> Symbolic:
        """getelementptr: bases and strides are exact, the rest wraps."""
        base, poison = self.scalar(path, i.args[0])
        t = i.extra["type"]
        assert isinstance(t, Type)
        for k, index in enumerate(i.args[1:]):
            if k and t.kind == "struct":
                assert isinstance(index, ConstInt)
                base = base + vector(struct_offsets(t)[index.value], 16)
                t = t.elems[index.value]
                continue
            t = t.elems[0] if k else t
            term, wrong = self.scalar(path, index)
            place = self.cast("sext", (term, None), Type("int", 16))[0]
            base, poison = base + place * vector(size_of(t), 16), either(poison, wrong)
        number = known(base)
        return (vector(number, 16) if number is not None else base), poison

    def _load(self, path: Path, i: Instr) -> Any:
        address = self._accessed(path, i.args[0], i.type, i)
        if i.volatile:
            size = store_size(i.type)
            value = self.unknown("read", 8 * size)
            path.show(Event("read", address, size, value, even=_is_even(i)))
            return self.cast("trunc", (value, None), i.type)
        return self._loaded(path, address, i.type)

    def _loaded(self, path: Path, address: Term, t: Type) -> Any:
        if t.kind == "struct":
            offsets = struct_offsets(t)
            return [self._loaded(path, address + o, e) for o, e in zip(offsets, t.elems, strict=False)]
        if t.kind not in ("int", "ptr", "float"):
            raise Undecided(f"a value of type {t}")
        return self.cast("trunc", (path.memory.read(address, store_size(t)), None), t)

    def _store(self, path: Path, i: Instr) -> None:
        t = i.args[0].type
        address = self._accessed(path, i.args[1], t, i)
        value = self.value(path, i.args[0])
        if i.volatile:
            term = self.cast("zext", (self.sure(path, i.args[0]), None), Type("int", 8 * store_size(t)))[0]
            path.show(Event("write", address, term.size() // 8, term, even=_is_even(i)))
            return
        self._stored(path, address, t, value)

    def _stored(self, path: Path, address: Term, t: Type, value: Any) -> None:
        if t.kind == "struct":
            for o, e, part in zip(struct_offsets(t), t.elems, value, strict=False):
                self._stored(path, address + o, e, part)
            return
        term, poison = value
        if poison is not None:
            path.assumed.append(z3.Not(poison))
        path.write(address, term)

    def _accessed(self, path: Path, pointer: Value, t: Type, i: Instr) -> Term:
        """The address, with what may be assumed of it: nothing private lies there, words are even."""
        address = self.sure(path, pointer)
        size = store_size(t) if t.kind in ("int", "ptr", "float") else size_of(t)
        return self.reached(path, address, size, _is_even(i))

    def reached(self, path: Path, address: Term, size: int, even: bool) -> Term:
        """As `_accessed`, of bytes at an address."""
        if known(address) is None:
            path.assumed.append(self.frame.spared(address, size))
            path.preferred.append(z3.And(z3.UGE(address, SFR_END), z3.ULT(address, self.frame.lowest - size)))
            if size > 1 and even:
                path.assumed.append(z3.Extract(0, 0, address) == 0)
        return address

    def _extract(self, path: Path, i: Instr) -> Any:
        found = self.value(path, i.args[0])
        indices = i.extra["indices"]
        assert isinstance(indices, list)
        for k in indices:
            found = found[k]
        return found

    def _insert(self, path: Path, i: Instr) -> Any:
        whole, part = self.value(path, i.args[0]), self.value(path, i.args[1])
        indices = i.extra["indices"]
        assert isinstance(indices, list)
        return _replaced(whole, indices, part)

    def _call(self, path: Path, i: Instr) -> Any:
        callee = i.args[-1]
        if isinstance(callee, InlineAsm):
            return self._assembly(path, i, callee)
        if isinstance(callee, GlobalRef) and callee.name.startswith("llvm."):
            base = base_of(callee.name)
            handler = INTRINSICS.get(base)
            if handler is None:
                raise Undecided(f"the intrinsic {base}")
            return handler(self, path, i)
        attributes = i.extra["attrs"]
        assert isinstance(attributes, list)
        target = callee.name if isinstance(callee, GlobalRef) else self._even(path, self.sure(path, callee))
        event = self.called(path, target, i.args[:-1], attributes)
        event.tail = i.extra.get("tail") in ("tail", "musttail")
        if i.extra.get("vararg"):
            assert isinstance(i.extra["fixed"], int)
            event.named = i.extra["fixed"]
        if i.type.kind != "void":
            event.value = self.of_type(i.type, lambda t: (self.unknown("result", t.bits), None))
        return event.value

    def _even(self, path: Path, pointer: Term) -> Term:
        """A pointer to code: no function has an odd address, and the machine does not look at that bit."""
        path.assumed.append(z3.Extract(0, 0, pointer) == 0)
        return pointer

    def called(
        self, path: Path, target: Any, values: list[Value], attributes: list[ParameterAttributes] | None = None
    ) -> Event:
        """A call of something that may change whatever others can reach."""
        attributes = attributes or [{} for _ in values]
        arguments = [(v, self.value(path, v), k) for v, k in zip(values, attributes, strict=True)]
        event = Event("call", target, arguments=arguments, memory=path.memory.copy())
        path.part(barrier=False)
        path.events.append(event)
        self._others_run(path, event)
        return event

    def _assembly(self, path: Path, i: Instr, code: InlineAsm) -> Any:
        shape = shape_of(code)
        inputs = [(v, self.value(path, v)) for v in i.args[:-1]]
        if shape.memory:
            path.part(barrier=True)
        if not code.text.strip():
            return self._unchanged(shape, inputs)
        event = Event("asm", plain(code.text), arguments=[(v, value, {}) for v, value in inputs], shape=shape)
        if i.type.kind != "void":
            event.value = self.of_type(i.type, lambda t: (self.unknown("stated", t.bits), None))
        if shape.memory:
            event.memory = path.memory.copy()
            path.events.append(event)
            self._others_run(path, event)
        else:
            path.show(event)
        return event.value

    def _unchanged(self, shape: Shape, inputs: list[tuple[Value, Any]]) -> Any:
        """What a statement without text gives: its outputs are the inputs tied to them."""
        places = [o.tied for o in shape.operands if not o.output]
        tied = {n: value for n, (_, value) in zip(places, inputs, strict=True)}
        outputs = [n for n, o in enumerate(shape.operands) if o.output]
        if any(n not in tied for n in outputs):
            raise Undecided("an assembly statement without text that gives something")
        return tied[outputs[0]] if len(outputs) == 1 else [tied[n] for n in outputs] or None

    def _others_run(self, path: Path, event: Event) -> None:
        event.after = z3.Array(f"memory.{len(path.events)}", z3.BitVecSort(16), z3.BitVecSort(8))
        path.memory.become(event.after, self.frame.kept())

    def _fence(self, path: Path, i: Instr) -> None:
        path.part(barrier=True)


def _is_even(i: Instr) -> bool:
    return str(i.extra.get("align", "")) != "1"


def _replaced(whole: list[Any], indices: list[int], part: Any) -> list[Any]:
    out = list(whole)
    out[indices[0]] = part if len(indices) == 1 else _replaced(whole[indices[0]], indices[1:], part)
    return out


_HANDLERS: Final[dict[str, Callable[[Evaluator, Path, Instr], Any]]] = {
    "icmp": Evaluator._compare, "fcmp": Evaluator._compare, "fneg": Evaluator._negated, "select": Evaluator._select,
    "freeze": Evaluator._freeze, "alloca": Evaluator._alloca, "getelementptr": Evaluator._address,
    "load": Evaluator._load, "store": Evaluator._store, "call": Evaluator._call, "extractvalue": Evaluator._extract,
    "insertvalue": Evaluator._insert, "fence": Evaluator._fence,
}  # fmt: skip
