"""Factors for dividing by constants with a multiplication (`legalize.magic`)."""

from __future__ import annotations

from toolchain.legalize.magic import signed_factor, unsigned_factor


def test_multiplication_divides_exactly() -> None:
    """`magic` gives the exact quotient: for every dividend of small divisors, and for a sample of other divisors."""
    for d in [*range(3, 16), 100, 641, 1000, *range(17, 32768, 977), 32765, 32767]:
        if d & (d - 1) == 0:
            continue
        (m, s), (n, t) = unsigned_factor(d), signed_factor(d)
        assert m < 2 << 16
        assert n < 1 << 16
        for x in range(0, 65536, 1 if d < 16 else 13):
            signed = x - 65536 if x & 0x8000 else x
            assert x * m >> 16 + s == x // d
            assert (signed * n >> 16 + t) + (signed < 0) == abs(signed) // d * (1 if signed >= 0 else -1)
