"""Arithmetic of C (C11 §6.3.1): promotion, usual arithmetic conversions, unsigned results modulo their width.

Inputs and outputs: integers and floating-point numbers with their types. For a signed overflow, which C leaves
undefined, the result is the exact number if a type can represent it.
"""

from __future__ import annotations

import math
import operator
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from emu.debug.dwarf.types import UNSIGNED, Type

INT: Final = 2
"""Size of an int in bytes."""
SIGNED: Final = {size: Type("signed", f"int{8 * size}", size, is_signed=True) for size in (2, 4, 8)}
FLOATING: Final = Type("float", "double", 8)
FLOAT: Final = Type("float", "float", 4)
WIDEST: Final = 64
"""Width of the longest type in bits. C does not define a shift by that many bits or more, and a shift by 10^10 would
exhaust the memory."""


@dataclass(frozen=True, slots=True)
class TypedNumber:
    """A value with its type, but without an address."""

    value: int | float
    kind: Type = SIGNED[INT]

    @property
    def is_integer(self) -> bool:
        """Whether the value is an integer, not a floating-point number."""
        return isinstance(self.value, int)


def integer_constant(
    value: int, *, unsigned: bool = False, size: int = INT, may_be_unsigned: bool = False
) -> TypedNumber:
    """Return a constant in the first type of at least `size` bytes that can represent it.

    Raises ValueError if no type can.
    """
    for bytes_ in (one for one in (2, 4, 8) if one >= size):
        if not unsigned and -(1 << 8 * bytes_ - 1) <= value < 1 << 8 * bytes_ - 1:
            return TypedNumber(value, SIGNED[bytes_])
        if (unsigned or may_be_unsigned) and 0 <= value < 1 << 8 * bytes_:
            return TypedNumber(value, UNSIGNED[bytes_])
    raise ValueError(f"no type holds {value:#x}")


def promote(value: Any, kind: Type, bits: int = 0) -> TypedNumber:
    """Return the value of an object of type `kind` after integer promotion. `bits` is the width of a bit field."""
    bare = kind.bare
    if isinstance(value, float):
        return TypedNumber(value, bare)
    width = bits or 8 * bare.size
    if width < 8 * INT or bare.kind == "bool":
        return TypedNumber(int(value))
    size = max(bare.size, INT)
    return TypedNumber(int(value), SIGNED[size] if bare.is_signed else UNSIGNED.get(size, UNSIGNED[8]))


def wrap_result(value: int | float, kind: Type) -> TypedNumber:
    """Return a result as type `kind`: unsigned modulo its width, signed in the first type that represents it."""
    if isinstance(value, float):
        return TypedNumber(_round_to(value, kind), kind)
    if kind.kind == "unsigned":
        return TypedNumber(value & (1 << 8 * kind.size) - 1, kind)
    for size in (2, 4, 8):
        if size >= kind.size and -(1 << 8 * size - 1) <= value < 1 << 8 * size - 1:
            return TypedNumber(value, SIGNED[size])
    return TypedNumber((value + (1 << 63)) % (1 << 64) - (1 << 63), SIGNED[8])


def _round_to(value: float, kind: Type) -> float:
    """Return `value` rounded to a floating-point type."""
    if kind.size != FLOAT.size:
        return value
    try:
        found: float = struct.unpack("<f", struct.pack("<f", value))[0]
    except OverflowError:
        return math.copysign(math.inf, value)
    return found


def convert(value: int | float, kind: Type) -> int | float:
    """Return `value` converted to a number, pointer or enumeration type (C11 §6.3.1).

    Raises ValueError for NaN and infinity as integers.
    """
    bare = kind.bare
    if bare.kind == "float":
        return _round_to(float(value), bare)
    if bare.kind == "bool":
        return int(bool(value))
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} is no whole number")
        value = int(value)
    bits = 8 * bare.size
    value &= (1 << bits) - 1
    return value - (1 << bits) if bare.is_signed and value >> bits - 1 else value


def common_type(one: Type, other: Type) -> Type:
    """Return the common type of two operands (usual arithmetic conversions)."""
    if "float" in (one.kind, other.kind):
        return max((kind for kind in (one, other) if kind.kind == "float"), key=lambda kind: kind.size)
    if one.size != other.size:
        return max(one, other, key=lambda kind: kind.size)
    return one if one.kind == "unsigned" else other


def _divide(a: Any, b: Any) -> int | float:
    """Divide as C does: truncate towards zero. Exact for integers of any size."""
    if isinstance(a, float) or isinstance(b, float):
        return float(a / b)
    size: int = abs(a) // abs(b)
    return size if (a < 0) == (b < 0) else -size


def _shift_count(bits: int) -> int:
    """Return a shift count that is in the range 0 to 63. Raises ValueError for any other."""
    if not 0 <= bits < WIDEST:
        raise ValueError(f"a shift by {bits} bits; expected 0 to {WIDEST - 1}")
    return bits


Rule = tuple[int, Callable[[Any, Any], Any]]
LOGIC: Final[dict[str, Rule]] = {
    "||": (1, lambda a, b: bool(a) or bool(b)),
    "&&": (2, lambda a, b: bool(a) and bool(b)),
}
COMPARISONS: Final[dict[str, Rule]] = {
    "==": (6, operator.eq), "!=": (6, operator.ne), "<": (7, operator.lt), ">": (7, operator.gt),
    "<=": (7, operator.le), ">=": (7, operator.ge),
}  # fmt: skip
SHIFTS: Final[dict[str, Rule]] = {
    "<<": (8, lambda a, b: operator.lshift(a, _shift_count(b))),
    ">>": (8, lambda a, b: operator.rshift(a, _shift_count(b))),
}
ARITHMETIC: Final[dict[str, Rule]] = {
    "|": (3, operator.or_), "^": (4, operator.xor), "&": (5, operator.and_),
    "+": (9, operator.add), "-": (9, operator.sub), "*": (10, operator.mul), "/": (10, _divide),
    "%": (10, lambda a, b: a - b * _divide(a, b)),
}  # fmt: skip
BINARY: Final = LOGIC | COMPARISONS | SHIFTS | ARITHMETIC
"""Precedence and function of each binary operator."""
INTEGER_ONLY: Final = ("|", "^", "&", "<<", ">>", "%")
"""Operators that accept only integers."""


def apply_binary(sign: str, one: TypedNumber, other: TypedNumber) -> TypedNumber:
    """Return the result of a binary operator. Raises ValueError or ArithmeticError for an undefined result."""
    compute = BINARY[sign][1]
    if sign in INTEGER_ONLY and not (one.is_integer and other.is_integer):
        raise ValueError(f"{sign} needs whole numbers")
    if sign in LOGIC:
        return TypedNumber(int(compute(one.value, other.value)))
    if sign in SHIFTS:
        return wrap_result(compute(one.value, other.value), one.kind)
    kind = common_type(one.kind, other.kind)
    if kind.kind == "float":
        left, right = convert(one.value, kind), convert(other.value, kind)
    else:
        left, right = wrap_result(one.value, kind).value, wrap_result(other.value, kind).value
    result = compute(left, right)
    return TypedNumber(int(result)) if sign in COMPARISONS else wrap_result(result, kind)


def negate(one: TypedNumber) -> TypedNumber:
    """Return `-one`."""
    return wrap_result(-one.value, one.kind)


def complement(one: TypedNumber) -> TypedNumber:
    """Return `~one`. Raises ValueError for a floating-point number."""
    if not isinstance(one.value, int):
        raise ValueError("~ needs whole numbers")
    return wrap_result(~one.value, one.kind)
