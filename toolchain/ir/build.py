"""Instruction builder with local constant folding, which IR passes use to create instructions."""

from __future__ import annotations

from typing import Unpack

from toolchain.ir.model import (
    I1,
    I8,
    I16,
    VOID,
    Block,
    ConstInt,
    GlobalRef,
    Instr,
    InstrExtra,
    Type,
    Undef,
    Value,
    int_type,
)

COMMUTATIVE = frozenset(("add", "mul", "and", "or", "xor"))


def const(t: Type, value: int) -> ConstInt:
    """Integer constant of the type; `value` is taken modulo 2^bits."""
    return ConstInt(t, value)


def evaluate(op: str, a: ConstInt, b: ConstInt) -> int | None:
    """Value of a binary operation on constants; None if it is undefined (LLVM LangRef) or not folded."""
    x, y, bits = a.value, b.value, a.type.bits
    match op:
        case "add":
            return x + y
        case "sub":
            return x - y
        case "mul":
            return x * y
        case "and":
            return x & y
        case "or":
            return x | y
        case "xor":
            return x ^ y
        case "shl" if y < bits:
            return x << y
        case "lshr" if y < bits:
            return x >> y
        case "ashr" if y < bits:
            return a.signed >> y
        case "udiv" if y:
            return x // y
        case "urem" if y:
            return x % y
    return None


def compare(pred: str, a: ConstInt, b: ConstInt) -> bool:
    """Result of icmp on constants."""
    x, y = (a.signed, b.signed) if pred[0] == "s" else (a.value, b.value)
    match pred[-2:]:
        case "eq":
            return x == y
        case "ne":
            return x != y
        case "lt":
            return x < y
        case "le":
            return x <= y
        case "gt":
            return x > y
        case _:
            return x >= y


class IrBuilder:
    """Appends instructions to one block. Methods return the value of the operation."""

    def __init__(self, block: Block) -> None:
        self.block = block
        self.line: str | None = None

    def emit(self, op: str, t: Type, args: list[Value], **extra: Unpack[InstrExtra]) -> Instr:
        """Append an instruction without folding."""
        i = Instr(op, t, args)
        i.line = self.line
        if extra:
            i.extra.update(extra)
        self.block.instrs.append(i)
        return i

    def binary(self, op: str, a: Value, b: Value) -> Value:
        """Build a binary integer operation; it is folded if an operand is a suitable constant."""
        if op in COMMUTATIVE and isinstance(a, ConstInt | GlobalRef) and not isinstance(b, ConstInt):
            a, b = b, a
        if isinstance(b, ConstInt):
            if isinstance(a, ConstInt):
                value = evaluate(op, a, b)
                if value is not None:
                    return const(a.type, value)
            folded = self._identity(op, a, b)
            if folded is not None:
                return folded
        return self.emit(op, a.type, [a, b])

    def _identity(self, op: str, a: Value, b: ConstInt) -> Value | None:
        ones = (1 << b.type.bits) - 1
        if b.value == 0:
            if op in ("add", "sub", "or", "xor", "shl", "lshr", "ashr"):
                return a
            if op in ("and", "mul"):
                return b
        elif (b.value == 1 and op in ("mul", "udiv", "sdiv")) or (b.value == ones and op == "and"):
            return a
        if op == "sub":
            op, b = "add", const(b.type, -b.value)
            if isinstance(a, GlobalRef):
                return GlobalRef(a.name, a.offset + b.signed)
            return self.binary("add", a, b)
        if op == "add":
            if isinstance(a, GlobalRef):
                return GlobalRef(a.name, a.offset + b.signed)
            if isinstance(a, Instr) and a.op == "add" and isinstance(a.args[1], ConstInt):
                return self.binary("add", a.args[0], const(b.type, a.args[1].value + b.value))
        if op == "mul" and b.value & (b.value - 1) == 0:
            return self.binary("shl", a, const(a.type, b.value.bit_length() - 1))
        if op == "udiv" and b.value & (b.value - 1) == 0 and b.value:
            return self.binary("lshr", a, const(a.type, b.value.bit_length() - 1))
        if op == "urem" and b.value & (b.value - 1) == 0 and b.value:
            return self.binary("and", a, const(a.type, b.value - 1))
        return None

    def cast(self, op: str, a: Value, t: Type) -> Value:
        """Build trunc, zext or sext; return `a` itself if the width does not change."""
        if a.type.bits == t.bits:
            return a
        if isinstance(a, ConstInt):
            return const(t, a.signed if op == "sext" else a.value)
        if isinstance(a, Undef):
            return const(t, 0)
        if isinstance(a, Instr) and a.op in ("zext", "sext"):
            inner = a.args[0]
            if op == "trunc":
                if inner.type.bits >= t.bits:
                    return self.cast("trunc", inner, t)
                return self.cast(a.op, inner, t)
            if op == a.op or (op == "sext" and a.op == "zext"):
                return self.cast(a.op, inner, t)
        return self.emit(op, t, [a])

    def icmp(self, pred: str, a: Value, b: Value) -> Value:
        """Build an integer comparison; its value is an i1."""
        if isinstance(a, ConstInt):
            if isinstance(b, ConstInt):
                return const(I1, compare(pred, a, b))
            a, b, pred = b, a, SWAPPED[pred]
        return self.emit("icmp", I1, [a, b], pred=pred)

    def select(self, c: Value, a: Value, b: Value) -> Value:
        """Build the value c ? a : b."""
        if isinstance(c, ConstInt):
            return a if c.value else b
        if a is b:
            return a
        if a.type is I1 and isinstance(a, ConstInt) and isinstance(b, ConstInt):
            return c if a.value > b.value else self.binary("xor", c, const(I1, 1)) if b.value > a.value else a
        return self.emit("select", a.type, [c, a, b])

    def logical_not(self, a: Value) -> Value:
        """Build the negation of an i1."""
        return self.binary("xor", a, const(I1, 1))

    def add(self, a: Value, offset: int) -> Value:
        """Build the sum of a value and a constant."""
        return self.binary("add", a, const(a.type, offset))

    def shift(self, op: str, a: Value, n: int) -> Value:
        """Build a shift by a constant (`shl`, `lshr` or `ashr`)."""
        return self.binary(op, a, const(a.type, n))

    def load(self, t: Type, p: Value, volatile: bool = False) -> Value:
        """Build a load of a legal integer type."""
        i = self.emit("load", t, [p])
        i.volatile = volatile
        return i

    def store(self, v: Value, p: Value, volatile: bool = False) -> None:
        """Build a store of a legal integer type."""
        self.emit("store", VOID, [v, p]).volatile = volatile

    def call(self, name: str, t: Type, args: list[Value]) -> Instr:
        """Build a call of a run-time library function by its C name (abi-elf.md §2.8)."""
        i = self.emit("call", t, [*args, GlobalRef(name)], attrs=[{} for _ in args], vararg=False)
        return i


SWAPPED = {
    "eq": "eq", "ne": "ne", "slt": "sgt", "sgt": "slt", "sle": "sge", "sge": "sle",
    "ult": "ugt", "ugt": "ult", "ule": "uge", "uge": "ule",
}  # fmt: skip


def legal_type(t: Type) -> Type:
    """The legal integer type that holds a type: i1, i8, i16 or a multiple of 16 bits."""
    if t.kind == "ptr":
        return I16
    if t.kind not in ("int", "float"):
        return t
    if t.bits == 1:
        return I1
    return I8 if t.bits <= 8 else int_type((t.bits + 15) // 16 * 16)
