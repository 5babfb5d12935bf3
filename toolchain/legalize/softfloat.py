"""Floating-point operations as calls of the run-time library (abi-elf.md §2.8); values are their bits, i32 or i64."""

from __future__ import annotations

from toolchain.ir.build import IrBuilder, const
from toolchain.ir.model import I16, I32, I64, Type, UnsupportedError, Value, int_type

MODE = {32: "sf", 64: "df"}
INT_MODE = {32: "si", 64: "di"}
ARITHMETIC = {"fadd": "__add{}3", "fsub": "__sub{}3", "fmul": "__mul{}3", "fdiv": "__div{}3"}
# By predicate: library function, and comparison of its result with 0. An unordered predicate is the negation of the
# opposite ordered one: for NaN, a function returns a value that makes the ordered comparison false (abi-elf.md §2.8).
COMPARISONS = {
    "oeq": ("eq", "eq"), "une": ("ne", "ne"), "olt": ("lt", "slt"), "ole": ("le", "sle"), "ogt": ("gt", "sgt"),
    "oge": ("ge", "sge"), "ult": ("ge", "slt"), "ule": ("gt", "sle"), "ugt": ("le", "sgt"), "uge": ("lt", "sge"),
    "uno": ("unord", "ne"), "ord": ("unord", "eq"),
}  # fmt: skip


def binary(b: IrBuilder, op: str, bits: int, x: Value, y: Value) -> Value:
    """Build fadd, fsub, fmul, fdiv or frem."""
    t = int_type(bits)
    if op == "frem":
        return b.call("fmodf" if bits == 32 else "fmod", t, [x, y])
    return b.call(ARITHMETIC[op].format(MODE[bits]), t, [x, y])


def compare(b: IrBuilder, pred: str, bits: int, x: Value, y: Value) -> Value:
    """Build fcmp, as an i1."""
    from toolchain.ir.model import I1

    if pred in ("true", "false"):
        return const(I1, pred == "true")
    if pred in ("ueq", "one"):
        unordered = compare(b, "uno", bits, x, y)
        equal = compare(b, "oeq", bits, x, y)
        either = b.binary("or", unordered, equal)
        return either if pred == "ueq" else b.logical_not(either)
    name, test = COMPARISONS[pred]
    result = b.call(f"__{name}{MODE[bits]}2", I16, [x, y])
    return b.icmp(test, result, const(I16, 0))


def from_int(b: IrBuilder, x: Value, signed: bool, bits: int) -> Value:
    """Build the conversion of an integer of legal width to floating point."""
    width = 32 if x.type.bits < 32 or (x.type.bits == 32) else 64
    if x.type.bits > 64:
        raise UnsupportedError(f"conversion of a {x.type.bits}-bit integer to floating point")
    wide = b.cast("sext" if signed else "zext", x, int_type(width))
    unsigned = "un" if not signed and x.type.bits in (32, 64) else ""
    return b.call(f"__float{unsigned}{INT_MODE[width]}{MODE[bits]}", int_type(bits), [wide])


def to_int(b: IrBuilder, x: Value, signed: bool, t: Type) -> Value:
    """Build the conversion to an integer; narrow ones are the low bits of a 32-bit one (abi-elf.md §2.8 `(int)f`)."""
    wide = I32 if t.bits <= 32 else I64
    if t.bits > 64:
        raise UnsupportedError(f"conversion of floating point to a {t.bits}-bit integer")
    unsigned = "uns" if not signed else ""
    result = b.call(f"__fix{unsigned}{MODE[x.type.bits]}{INT_MODE[wide.bits]}", wide, [x])
    return b.cast("trunc", result, t)
