"""Integers of the instruction table as z3 terms, or as plain ints if they are known.

A table value is an exact integer.  `SymbolicInteger` has it in 48 bits, enough for products of two words and a 40-bit
accumulator.  Its low word is a separate term, so that 16-bit computations give the same terms as in the source.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import z3

BITS = 48
"""Width in bits of the integers with which the table computes; products of two words need 33."""
WORD = 16
HALF = 0x8000

Term: TypeAlias = Any
"""A z3 expression. The package z3 has no type annotations."""


def constant_value(term: Term) -> int | None:
    """Return the value of a constant bit vector, None if it does not simplify to a constant."""
    if z3.is_bv_value(term):
        return int(term.as_long())
    small = z3.simplify(term)
    return int(small.as_long()) if z3.is_bv_value(small) else None


def vector(value: int, bits: int) -> Term:
    """Return a constant bit vector."""
    return z3.BitVecVal(value, bits)


def truth(bit: Term) -> Term:
    """Return the condition that a one-bit vector is 1."""
    return bit == vector(1, 1)


def one_bit(condition: Term) -> Term:
    """Return a condition as a one-bit vector."""
    return z3.If(condition, vector(1, 1), vector(0, 1))


class SymbolicInteger:
    """A symbolic integer.

    wide     the integer in 48 bits
    word     its low 16 bits
    truth    the condition that it is 1, if it is known to be 0 or 1
    narrow   whether it equals its zero-extended word
    signed   whether it equals its sign-extended word
    flipped  the word from which it results by inverting the top bit, an intermediate step of sign extension
    """

    __slots__ = ("flipped", "narrow", "signed", "truth", "wide", "word")

    def __init__(self, wide: Term, word: Term | None = None, truth: Term | None = None, narrow: bool = False) -> None:
        self.signed = False
        self.flipped: Term | None = None
        self.wide = wide
        self.word = z3.Extract(WORD - 1, 0, wide) if word is None else word
        self.truth = truth
        self.narrow = narrow

    def _with(self, make: Callable[[Term, Term], Term], other: Any, swapped: bool = False) -> SymbolicInteger:
        a, b = self, other
        if swapped:
            a, b = b, a
        return SymbolicInteger(make(wide(a), wide(b)), make(word(a), word(b)))

    def _bits(self, make: Callable[[Term, Term], Term], logic: Callable[..., Term], other: Any) -> SymbolicInteger:
        if self.truth is not None and ((isinstance(other, int) and other in (0, 1)) or condition(other) is not None):
            there = z3.BoolVal(bool(other)) if isinstance(other, int) else condition(other)
            return truth_number(logic(self.truth, there))
        found = self._with(make, other)
        inside = (isinstance(other, SymbolicInteger) and other.narrow) or (
            isinstance(other, int) and 0 <= other < 1 << WORD
        )
        if make is _and:
            found.narrow = inside or self.narrow
            if found.narrow:
                found.wide = z3.ZeroExt(BITS - WORD, found.word)
        else:
            found.narrow = inside and self.narrow
        return found

    def _compared(self, make: Callable[[Term, Term], Term], other: Any) -> SymbolicInteger:
        if make in (_equal, _unequal) and self.narrow and isinstance(other, int) and 0 <= other < 1 << WORD:
            return truth_number(make(self.word, vector(other, WORD)))
        if make in (_equal, _unequal) and self.truth is not None and isinstance(other, int) and other in (0, 1):
            return truth_number(self.truth if (other == 1) == (make is _equal) else z3.Not(self.truth))
        return truth_number(make(self.wide, wide(other)))

    def __add__(self, o: Any) -> SymbolicInteger:
        return self._with(lambda a, b: a + b, o)

    __radd__ = __add__

    def __sub__(self, o: Any) -> SymbolicInteger:
        if self.flipped is not None and isinstance(o, int) and o == HALF:
            return signed_number(self.flipped)
        return self._with(lambda a, b: a - b, o)

    def __rsub__(self, o: Any) -> SymbolicInteger:
        return self._with(lambda a, b: a - b, o, swapped=True)

    def __mul__(self, o: Any) -> SymbolicInteger:
        a, b = factor(self), factor(o)
        if a is None or b is None:
            return self._with(lambda x, y: x * y, o)
        extend = z3.SignExt if is_signed(self) or is_signed(o) else z3.ZeroExt
        return SymbolicInteger(extend(BITS - 2 * WORD, a * b), word(self) * word(o))

    __rmul__ = __mul__

    def __and__(self, o: Any) -> SymbolicInteger:
        return self._bits(_and, z3.And, o)

    __rand__ = __and__

    def __or__(self, o: Any) -> SymbolicInteger:
        return self._bits(lambda a, b: a | b, z3.Or, o)

    __ror__ = __or__

    def __xor__(self, o: Any) -> SymbolicInteger:
        found = self._bits(lambda a, b: a ^ b, z3.Xor, o)
        if self.narrow and isinstance(o, int) and o == HALF:
            found.flipped = self.word
        return found

    __rxor__ = __xor__

    def __lshift__(self, o: Any) -> SymbolicInteger:
        if isinstance(o, int):
            return SymbolicInteger(self.wide << o, self.word << min(o, WORD))
        return SymbolicInteger(self.wide << wide(o))

    def __rlshift__(self, o: Any) -> SymbolicInteger:
        return SymbolicInteger(wide(o) << self.wide)

    def __rshift__(self, o: Any) -> SymbolicInteger:
        if isinstance(o, int) and self.narrow:
            less = z3.LShR(self.word, min(o, WORD))
            return SymbolicInteger(z3.ZeroExt(BITS - WORD, less), less, narrow=True)
        return SymbolicInteger(self.wide >> wide(o))

    def __rrshift__(self, o: Any) -> SymbolicInteger:
        return SymbolicInteger(wide(o) >> self.wide)

    def __neg__(self) -> SymbolicInteger:
        return SymbolicInteger(-self.wide, -self.word)

    def __invert__(self) -> SymbolicInteger:
        return SymbolicInteger(~self.wide, ~self.word)

    def __lt__(self, o: Any) -> SymbolicInteger:
        return self._compared(lambda a, b: a < b, o)

    def __le__(self, o: Any) -> SymbolicInteger:
        return self._compared(lambda a, b: a <= b, o)

    def __gt__(self, o: Any) -> SymbolicInteger:
        return self._compared(lambda a, b: a > b, o)

    def __ge__(self, o: Any) -> SymbolicInteger:
        return self._compared(lambda a, b: a >= b, o)

    def __eq__(self, o: object) -> SymbolicInteger:  # type: ignore[override]
        return self._compared(_equal, o)

    def __ne__(self, o: object) -> SymbolicInteger:  # type: ignore[override]
        return self._compared(_unequal, o)

    __hash__ = None  # type: ignore[assignment]


def _and(a: Term, b: Term) -> Term:
    return a & b


def _equal(a: Term, b: Term) -> Term:
    return a == b


def _unequal(a: Term, b: Term) -> Term:
    return a != b


def wide(value: Any) -> Term:
    """Return a value of the instruction table's rules in 48 bits."""
    return value.wide if isinstance(value, SymbolicInteger) else vector(int(value), BITS)


def word(value: Any) -> Term:
    """Return the low word of a table value."""
    return value.word if isinstance(value, SymbolicInteger) else vector(int(value), WORD)


def condition(value: Any) -> Term | None:
    """Return the condition that a table value is 1 if it is known to be 0 or 1, else None."""
    return value.truth if isinstance(value, SymbolicInteger) else None


def holds(value: Any) -> Term:
    """Return the condition that a table value is not 0."""
    if isinstance(value, SymbolicInteger):
        return value.truth if value.truth is not None else value.wide != 0
    return z3.BoolVal(bool(value))


def narrow(term: Term) -> SymbolicInteger | int:
    """Return a term of at most 16 bits, zero-extended, as a table value; an int if it is constant."""
    if z3.is_bv_value(term):
        return int(term.as_long())
    if term.size() < WORD:
        term = z3.ZeroExt(WORD - term.size(), term)
    return SymbolicInteger(z3.ZeroExt(BITS - WORD, term), term, narrow=True)


def truth_number(term: Term) -> SymbolicInteger:
    """Return a condition as the table value 0 or 1."""
    return SymbolicInteger(
        z3.If(term, vector(1, BITS), vector(0, BITS)), z3.If(term, vector(1, WORD), vector(0, WORD)), term, True
    )


def signed_number(term: Term) -> SymbolicInteger:
    """Return a word as a signed table value."""
    found = SymbolicInteger(z3.SignExt(BITS - WORD, term), term)
    found.signed = True
    return found


def is_signed(value: Any) -> bool:
    """Whether a table value may be negative."""
    return value < 0 if isinstance(value, int) else value.signed


def is_narrow(value: Any) -> bool:
    """Whether a table value is in 0..65535."""
    return 0 <= value < 1 << WORD if isinstance(value, int) else value.narrow


def is_short(value: Any) -> bool:
    """Whether a table value is in -32768..32767."""
    return -HALF <= value < HALF if isinstance(value, int) else value.signed


def factor(value: Any) -> Term | None:
    """Return a table value in 32 bits if products of two such values fit 32 bits, else None."""
    if isinstance(value, int):
        return vector(value, 2 * WORD) if -HALF <= value < 2 * HALF else None
    if value.signed:
        return z3.SignExt(WORD, value.word)
    return z3.ZeroExt(WORD, value.word) if value.narrow else None


def product(a: Term, b: Term) -> Term:
    """Return a * b for operands of equal size.

    A 32-bit product is written as the machine computes it, the sum of three 16-bit products. For a solver it is hard
    to prove that both forms are equal.
    """
    if a.size() != 2 * WORD or any(_is_extended(one) for one in (a, b)):
        return a * b
    (a_low, a_high), (b_low, b_high) = halves(a), halves(b)
    low = z3.ZeroExt(WORD, a_low) * z3.ZeroExt(WORD, b_low)
    return low + (z3.ZeroExt(WORD, a_low * b_high + a_high * b_low) << WORD)


def _is_extended(term: Term) -> bool:
    return z3.is_app(term) and term.decl().kind() in (z3.Z3_OP_SIGN_EXT, z3.Z3_OP_ZERO_EXT)


def halves(term: Term) -> tuple[Term, Term]:
    """Return low and high word of 32 bits."""
    return z3.simplify(z3.Extract(WORD - 1, 0, term)), z3.simplify(z3.Extract(2 * WORD - 1, WORD, term))


def lowest_bit(value: Any) -> Any:
    """Return the lowest bit of a table value as a flag."""
    if isinstance(value, int):
        return value & 1
    return value if value.truth is not None else truth_number(z3.Extract(0, 0, value.word) == 1)
