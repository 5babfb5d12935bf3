"""Operands of LLVM IR as terms, and casts.

A value is a vector and the condition under which it is poison (None: never).  An aggregate is a list of values.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

import z3

from toolchain.ir.model import (
    Arg,
    ConstAgg,
    ConstBytes,
    ConstExpr,
    ConstInt,
    ConstZero,
    GlobalRef,
    Instr,
    Type,
    Undef,
    Value,
)
from toolchain.proof.path import Path
from toolchain.proof.solver import Undecided
from toolchain.proof.terms import Term, product, vector

Symbolic: TypeAlias = tuple[Term, Term | None]
"""A vector, and the condition under which it is poison."""
SUMS: Final[dict[str, Callable[[Term, Term], Term]]] = {
    "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": product, "and": lambda a, b: a & b,
    "or": lambda a, b: a | b, "xor": lambda a, b: a ^ b,
}  # fmt: skip


class OperandValues:
    """Values of operands on a path; `address` returns the address of a global."""

    def __init__(self, address: Callable[[str], int]) -> None:
        self.address: Final = address
        self.fresh = 0

    def value(self, path: Path, v: Value) -> Any:
        """Return the value of an operand."""
        match v:
            case Instr() | Arg():
                return path.values[id(v)]
            case ConstInt():
                return vector(v.value, v.type.bits), None
            case GlobalRef():
                return vector(self._place(v.name) + v.offset, 16), None
            case Undef():
                return self.of_type(v.type, lambda t: (self.unknown("undef", t.bits), z3.BoolVal(True)))
            case ConstZero():
                return self.of_type(v.type, lambda t: (vector(0, t.bits), None))
            case ConstAgg():
                return [self.value(path, e) for e in v.elems]
            case ConstBytes():
                return [(vector(b, 8), None) for b in v.data]
            case ConstExpr():
                return self._expression(path, v)
            case _:
                raise Undecided(f"an operand {type(v).__name__}")

    def _place(self, name: str) -> int:
        try:
            return self.address(name)
        except KeyError:
            raise Undecided(f"no address of {name}") from None

    def _expression(self, path: Path, v: ConstExpr) -> Symbolic:
        parts = [self.value(path, a) for a in v.args]
        if v.op in SUMS:
            return SUMS[v.op](parts[0][0], parts[1][0]), None
        return self.cast(v.op, parts[0], v.type)

    def of_type(self, t: Type, make: Callable[[Type], Any]) -> Any:
        if t.kind in ("int", "ptr", "float"):
            return make(t)
        if t.kind == "struct":
            return [self.of_type(e, make) for e in t.elems]
        if t.kind == "array":
            return [self.of_type(t.elems[0], make) for _ in range(t.count)]
        raise Undecided(f"a value of type {t}")

    def sure(self, path: Path, v: Value) -> Term:
        """Return the term of an operand and assume that it is not poison."""
        term, poison = self.scalar(path, v)
        if poison is not None:
            path.assumptions.append(z3.Not(poison))
        return term

    def scalar(self, path: Path, v: Value) -> Symbolic:
        found = self.value(path, v)
        if isinstance(found, list):
            raise Undecided(f"an aggregate of type {v.type}")
        return found  # type: ignore[no-any-return]

    def unknown(self, name: str, bits: int) -> Term:
        """Return a new unconstrained vector."""
        self.fresh += 1
        return z3.BitVec(f"{name}.{self.fresh}", bits)

    def cast(self, op: str, value: Symbolic, t: Type) -> Symbolic:
        term, poison = value
        more = t.bits - term.size()
        if op == "sext" and more > 0:
            return z3.SignExt(more, term), poison
        if more > 0:
            return z3.ZeroExt(more, term), poison
        return (z3.Extract(t.bits - 1, 0, term) if more < 0 else term), poison


def either(a: Term | None, b: Term | None) -> Term | None:
    """Return the disjunction of two poison conditions."""
    if a is None or b is None:
        return b if a is None else a
    return z3.Or(a, b)
