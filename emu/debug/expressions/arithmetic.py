"""Numbers as C computes them (C11 §6.3.1): promotion, the usual conversions, unsigned results modulo their width.

What enters: whole and floating numbers with their types. What leaves: the same. Where C leaves the result of a signed
overflow undefined, it is the exact number as long as a type holds it.
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
"""Bytes of an int."""
SIGNED: Final = {size: Type("signed", f"int{8 * size}", size, is_signed=True) for size in (2, 4, 8)}
FLOATING: Final = Type("float", "double", 8)
FLOAT: Final = Type("float", "float", 4)
WIDEST: Final = 64
"""Bits of the longest type: a shift by as many means nothing in C, and one by 10^10 would fill the memory."""


@dataclass(frozen=True, slots=True)
class Number:
    """A value that has a type, but no place."""

    value: int | float
    kind: Type = SIGNED[INT]

    @property
    def is_whole(self) -> bool:
        """Whether it is none with a fraction."""
        return isinstance(self.value, int)


def whole(value: int, *, unsigned: bool = False, size: int = INT, may_be_unsigned: bool = False) -> Number:
    """A constant: of the first type that holds it, from `size` bytes on. Raises ValueError for one too long."""
    for bytes_ in (one for one in (2, 4, 8) if one >= size):
        if not unsigned and -(1 << 8 * bytes_ - 1) <= value < 1 << 8 * bytes_ - 1:
            return Number(value, SIGNED[bytes_])
        if (unsigned or may_be_unsigned) and 0 <= value < 1 << 8 * bytes_:
            return Number(value, UNSIGNED[bytes_])
    raise ValueError(f"no type holds {value:#x}")


def promoted(value: Any, kind: Type, bits: int = 0) -> Number:
    """What is read from a place of that type; `bits` of a bit field."""
    bare = kind.bare
    if isinstance(value, float):
        return Number(value, bare)
    width = bits or 8 * bare.size
    if width < 8 * INT or bare.kind == "bool":
        return Number(int(value))
    size = max(bare.size, INT)
    return Number(int(value), SIGNED[size] if bare.is_signed else UNSIGNED.get(size, UNSIGNED[8]))


def fitted(value: int | float, kind: Type) -> Number:
    """A result of that type."""
    if isinstance(value, float):
        return Number(_rounded(value, kind), kind)
    if kind.kind == "unsigned":
        return Number(value & (1 << 8 * kind.size) - 1, kind)
    for size in (2, 4, 8):
        if size >= kind.size and -(1 << 8 * size - 1) <= value < 1 << 8 * size - 1:
            return Number(value, SIGNED[size])
    return Number((value + (1 << 63)) % (1 << 64) - (1 << 63), SIGNED[8])


def _rounded(value: float, kind: Type) -> float:
    """What a floating type of that size holds."""
    if kind.size != FLOAT.size:
        return value
    try:
        found: float = struct.unpack("<f", struct.pack("<f", value))[0]
    except OverflowError:
        return math.copysign(math.inf, value)
    return found


def converted(value: int | float, kind: Type) -> int | float:
    """`value` as a number, pointer or enumerator of that type (C11 §6.3.1). Raises ValueError for NaN and infinity as
    whole numbers."""
    bare = kind.bare
    if bare.kind == "float":
        return _rounded(float(value), bare)
    if bare.kind == "bool":
        return int(bool(value))
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} is no whole number")
        value = int(value)
    bits = 8 * bare.size
    value &= (1 << bits) - 1
    return value - (1 << bits) if bare.is_signed and value >> bits - 1 else value


def common(one: Type, other: Type) -> Type:
    """The type in which two are computed."""
    if "float" in (one.kind, other.kind):
        return max((kind for kind in (one, other) if kind.kind == "float"), key=lambda kind: kind.size)
    if one.size != other.size:
        return max(one, other, key=lambda kind: kind.size)
    return one if one.kind == "unsigned" else other


def _divided(a: Any, b: Any) -> int | float:
    """Towards zero, as C divides; exact for whole numbers of any size."""
    if isinstance(a, float) or isinstance(b, float):
        return float(a / b)
    size: int = abs(a) // abs(b)
    return size if (a < 0) == (b < 0) else -size


def _within(bits: int) -> int:
    """A count of a shift. Raises ValueError."""
    if not 0 <= bits < WIDEST:
        raise ValueError(f"a shift by {bits} bits; expected 0 to {WIDEST - 1}")
    return bits


Rule = tuple[int, Callable[[Any, Any], Any]]
LOGIC: Final[dict[str, Rule]] = {
    "||": (1, lambda a, b: bool(a) or bool(b)),
    "&&": (2, lambda a, b: bool(a) and bool(b)),
}
COMPARING: Final[dict[str, Rule]] = {
    "==": (6, operator.eq), "!=": (6, operator.ne), "<": (7, operator.lt), ">": (7, operator.gt),
    "<=": (7, operator.le), ">=": (7, operator.ge),
}  # fmt: skip
SHIFTS: Final[dict[str, Rule]] = {
    "<<": (8, lambda a, b: operator.lshift(a, _within(b))),
    ">>": (8, lambda a, b: operator.rshift(a, _within(b))),
}
ARITHMETIC: Final[dict[str, Rule]] = {
    "|": (3, operator.or_), "^": (4, operator.xor), "&": (5, operator.and_),
    "+": (9, operator.add), "-": (9, operator.sub), "*": (10, operator.mul), "/": (10, _divided),
    "%": (10, lambda a, b: a - b * _divided(a, b)),
}  # fmt: skip
BINARY: Final = LOGIC | COMPARING | SHIFTS | ARITHMETIC
"""Rank and meaning of operators with two operands."""
WHOLE: Final = ("|", "^", "&", "<<", ">>", "%")
"""Operators for whole numbers only."""


def computed(sign: str, one: Number, other: Number) -> Number:
    """`one` `sign` `other`. Raises ValueError, ArithmeticError for what means nothing."""
    compute = BINARY[sign][1]
    if sign in WHOLE and not (one.is_whole and other.is_whole):
        raise ValueError(f"{sign} needs whole numbers")
    if sign in LOGIC:
        return Number(int(compute(one.value, other.value)))
    if sign in SHIFTS:
        return fitted(compute(one.value, other.value), one.kind)
    kind = common(one.kind, other.kind)
    if kind.kind == "float":
        left, right = converted(one.value, kind), converted(other.value, kind)
    else:
        left, right = fitted(one.value, kind).value, fitted(other.value, kind).value
    result = compute(left, right)
    return Number(int(result)) if sign in COMPARING else fitted(result, kind)


def negated(one: Number) -> Number:
    """`-one`."""
    return fitted(-one.value, one.kind)


def complemented(one: Number) -> Number:
    """`~one`. Raises ValueError for a floating number."""
    if not isinstance(one.value, int):
        raise ValueError("~ needs whole numbers")
    return fitted(~one.value, one.kind)
