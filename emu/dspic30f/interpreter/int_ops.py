"""Integer operations that Python's operators lack, for the interpreter and constant folding."""

from __future__ import annotations


def div_trunc(a: int, b: int) -> int:
    """Return the quotient rounded towards zero; 0 for b = 0."""
    if b == 0:
        return 0
    quotient = abs(a) // abs(b)
    return quotient if (a < 0) == (b < 0) else -quotient


def rem_trunc(a: int, b: int) -> int:
    """Return the remainder, which has the sign of `a`; 0 for b = 0."""
    return 0 if b == 0 else a - div_trunc(a, b) * b


def clz16(v: int) -> int:
    """Return the number of leading zeros of a 16-bit value, 16 for 0."""
    return 16 - int(v).bit_length()


def ctz16(v: int) -> int:
    """Return the number of trailing zeros of a 16-bit value, 16 for 0."""
    return (v & -v).bit_length() - 1 if v else 16
