"""Symbolic execution of optimised LLVM IR, path by path, with the observable events of each path.

Undefined behaviour becomes an assumption of its path.  The IR reader drops `nsw`, `nuw` and `exact`, so sums wrap as
they do in the machine, and a proof covers more inputs than the IR defines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Set
from typing import Any, Final

import z3

from toolchain.ir.model import (
    Block,
    ConstInt,
    Function,
    GlobalRef,
    InlineAsm,
    Instr,
    Type,
    Value,
    size_of,
    store_size,
    struct_offsets,
)
from toolchain.proof.asm_statements import Shape, plain, shape_of
from toolchain.proof.ir import floats
from toolchain.proof.ir.effects import Effects
from toolchain.proof.ir.intrinsics import INTRINSICS, base_of
from toolchain.proof.ir.operands import SUMS, Symbolic, either
from toolchain.proof.memory import StackFrame
from toolchain.proof.path import Event, Path
from toolchain.proof.solver import Undecided, feasible
from toolchain.proof.terms import Term, constant_value, one_bit, truth, vector

MAX_VISITS: Final = 70
"""Greatest number of visits of a block on one path."""
MAX_FORKS: Final = 4
"""Greatest number of input-dependent branches of one block on a path."""
MAX_PATHS: Final = 400
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


class Evaluator(Effects):
    """Symbolic execution of one function; `frame` has the addresses of its variables."""

    def __init__(
        self, function: Function, frame: StackFrame, address: Callable[[str], int], watched: Set[str] = frozenset()
    ) -> None:
        """Prepare the execution; at visits of blocks in `watched`, paths record all values (`Path.loop_visits`)."""
        super().__init__(frame, address)
        self.watched: Final = watched
        self.function: Final = function
        self.blocks: Final = {b.name: b for b in function.blocks}
        self._slots = {i.name: i for b in function.blocks for i in b.instrs if i.op == "alloca"}

    def paths(self, start: Path, first: str = "", heads: Set[str] = frozenset(), most: int = 0) -> Iterator[Path]:
        """Yield every feasible path from the block `first`, or the entry, to a return or one of `heads`.

        The phis of `first` have values on the path `start`.  With `most`, paths with more input-dependent branches of
        one block are skipped.  Raises Undecided.
        """
        work: list[tuple[Path, Block, str]] = [(start, self.blocks[first or self.function.blocks[0].name], "")]
        ended = 0
        while work:
            path, block, came = work.pop()
            while True:
                if came:
                    self._enter(path, block, came)
                    if block.name in heads:
                        path.fix_store_order(barrier=False)
                        path.end_kind, path.head = "loop", block.name
                        yield path
                        break
                following = self._block(path, block)
                if not following:
                    ended += 1
                    if ended > MAX_PATHS:
                        raise Undecided(f"more than {MAX_PATHS} paths")
                    yield path
                    break
                possible = (
                    following
                    if len(following) == 1
                    else [(c, n) for c, n in following if feasible([*path.conditions, c])]
                )
                if not possible:
                    break
                came = block.name
                if len(possible) > 1:
                    path.forks[came] = path.forks.get(came, 0) + 1
                    if most and path.forks[came] > most:
                        break
                    if path.forks[came] > MAX_FORKS:
                        raise Undecided("a loop with an unknown number of iterations")
                for condition, name in possible[1:]:
                    other = path.copy()
                    other.branch_conditions.append(condition)
                    work.append((other, self.blocks[name], came))
                condition, name = possible[0]
                if len(following) > 1:
                    path.branch_conditions.append(condition)
                block = self.blocks[name]

    # -- a block -----------------------------------------------------------------------------------------------------

    def _enter(self, path: Path, block: Block, came: str) -> None:
        """Assign the phis of a block that is entered from the block `came`."""
        entered = [(phi, self.value(path, phi.args[phi.blocks.index(came)])) for phi in block.phis()]
        for phi, value in entered:
            path.values[id(phi)] = value

    def _block(self, path: Path, block: Block) -> list[tuple[Term, str]]:
        """Execute a block; return (condition, block) of each successor."""
        path.visits[block.name] = path.visits.get(block.name, 0) + 1
        if path.visits[block.name] > MAX_VISITS:
            raise Undecided("a loop with an unknown number of iterations")
        if block.name in self.watched:
            path.loop_visits.append((block.name, dict(path.values), len(path.events)))
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
            path.fix_store_order(barrier=False)
        if i.op == "ret":
            path.result, path.end_kind = (self.value(path, i.args[0]) if i.args else None), "ret"
            return []
        if i.op == "unreachable":
            path.end_kind = "unreachable"
            return []
        if i.op == "indirectbr":
            raise Undecided("a computed goto")
        if not i.args:
            return [(z3.BoolVal(True), i.blocks[0])]
        term = self.sure(path, i.args[0])
        if i.op == "br":
            if i.blocks[0] == i.blocks[1]:
                return [(z3.BoolVal(True), i.blocks[0])]
            place = constant_value(term)
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

    def assign_before(self, path: Path, i: Instr) -> None:
        """Assign the value of an instruction that precedes a path: computed, or unknown if it depends on memory."""
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
            path.assumptions.append(b != 0)
            if i.op in ("sdiv", "srem"):
                least = vector(1 << i.type.bits - 1, i.type.bits)
                path.assumptions.append(z3.Not(z3.And(a == least, b == vector(-1, i.type.bits))))
            return QUOTIENTS[i.op](a, b), poison
        if i.op in SHIFTS:
            amount = constant_value(b)
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
        place = constant_value(c)
        a, b = self.value(path, i.args[1]), self.value(path, i.args[2])
        if place is not None:
            return a if place else b
        if isinstance(a, list):
            raise Undecided("a select of aggregates")
        mixed = None
        if a[1] is not None or b[1] is not None:
            false = z3.BoolVal(False)
            mixed = z3.If(truth(c), false if a[1] is None else a[1], false if b[1] is None else b[1])
        return z3.If(truth(c), a[0], b[0]), either(poison, mixed)

    def _freeze(self, path: Path, i: Instr) -> Any:
        term, poison = self.scalar(path, i.args[0])
        if poison is not None and feasible([*path.conditions, poison]):
            raise Undecided("freeze of a possibly undefined value")
        return term, None

    def _alloca(self, path: Path, i: Instr) -> Symbolic:
        if i.name not in self.frame.objects:
            raise Undecided("a variable without a frame location")
        return vector(self.frame.objects[i.name][0], 16), None

    def _address(self, path: Path, i: Instr) -> Symbolic:
        """Return the address of a getelementptr; sums wrap."""
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
        number = constant_value(base)
        return (vector(number, 16) if number is not None else base), poison

    def _load(self, path: Path, i: Instr) -> Any:
        address = self._accessed(path, i.args[0], i.type, i)
        if i.volatile:
            size = store_size(i.type)
            value = self.unknown("read", 8 * size)
            path.record_event(Event("read", address, size, value, aligned=_is_even(i)))
            return self.cast("trunc", (value, None), i.type)
        return self._load_at(path, address, i.type)

    def _load_at(self, path: Path, address: Term, t: Type) -> Any:
        if t.kind == "struct":
            offsets = struct_offsets(t)
            return [self._load_at(path, address + o, e) for o, e in zip(offsets, t.elems, strict=False)]
        if t.kind not in ("int", "ptr", "float"):
            raise Undecided(f"a value of type {t}")
        return self.cast("trunc", (path.memory.read(address, store_size(t)), None), t)

    def _store(self, path: Path, i: Instr) -> None:
        t = i.args[0].type
        address = self._accessed(path, i.args[1], t, i)
        value = self.value(path, i.args[0])
        if i.volatile:
            term = self.cast("zext", (self.sure(path, i.args[0]), None), Type("int", 8 * store_size(t)))[0]
            path.record_event(Event("write", address, term.size() // 8, term, aligned=_is_even(i)))
            return
        self._store_at(path, address, t, value)

    def _store_at(self, path: Path, address: Term, t: Type, value: Any) -> None:
        if t.kind == "struct":
            for o, e, part in zip(struct_offsets(t), t.elems, value, strict=False):
                self._store_at(path, address + o, e, part)
            return
        term, poison = value
        if poison is not None:
            path.assumptions.append(z3.Not(poison))
        path.write(address, term)

    def _accessed(self, path: Path, pointer: Value, t: Type, i: Instr) -> Term:
        """Return the address of a load or store, with the assumptions of `access`."""
        address = self.sure(path, pointer)
        size = store_size(t) if t.kind in ("int", "ptr", "float") else size_of(t)
        return self.access(path, address, size, _is_even(i))

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
        target = callee.name if isinstance(callee, GlobalRef) else self._assume_even(path, self.sure(path, callee))
        event = self.record_call(path, target, i.args[:-1], attributes)
        event.is_tail_call = i.extra.get("tail") in ("tail", "musttail")
        if i.extra.get("vararg"):
            assert isinstance(i.extra["fixed"], int)
            event.named_arguments = i.extra["fixed"]
        if i.type.kind != "void":
            event.value = self.of_type(i.type, lambda t: (self.unknown("result", t.bits), None))
        return event.value

    def _assume_even(self, path: Path, pointer: Term) -> Term:
        """Assume that a code pointer is even, because the machine ignores its lowest bit; return the pointer."""
        path.assumptions.append(z3.Extract(0, 0, pointer) == 0)
        return pointer

    def _assembly(self, path: Path, i: Instr, code: InlineAsm) -> Any:
        shape = shape_of(code)
        inputs = [(v, self.value(path, v)) for v in i.args[:-1]]
        if shape.memory:
            path.fix_store_order(barrier=True)
        if not code.text.strip():
            return self._unchanged(shape, inputs)
        event = Event("asm", plain(code.text), arguments=[(v, value, {}) for v, value in inputs], shape=shape)
        if i.type.kind != "void":
            event.value = self.of_type(i.type, lambda t: (self.unknown("stated", t.bits), None))
        if shape.memory:
            event.memory = path.memory.copy()
            path.events.append(event)
            self.havoc_memory(path, event)
        else:
            path.record_event(event)
        return event.value

    def _unchanged(self, shape: Shape, inputs: list[tuple[Value, Any]]) -> Any:
        """Return the outputs of an assembly statement with an empty template: the inputs tied to them."""
        places = [o.tied for o in shape.operands if not o.output]
        tied = {n: value for n, (_, value) in zip(places, inputs, strict=True)}
        outputs = [n for n, o in enumerate(shape.operands) if o.output]
        if any(n not in tied for n in outputs):
            raise Undecided("an assembly statement without text that has an untied output")
        return tied[outputs[0]] if len(outputs) == 1 else [tied[n] for n in outputs] or None

    def _fence(self, path: Path, i: Instr) -> None:
        path.fix_store_order(barrier=True)


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
