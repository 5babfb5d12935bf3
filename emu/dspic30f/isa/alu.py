"""ALU operations on 8 or 16 bits: results and flags (isa.md §6).

An operation takes the builder, the size and zero-extended operands. It sets its flags and returns the truncated result.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from .builder import Builder, Size
from .flow import Value

Unary: TypeAlias = Callable[[Builder, Size, Value], Value]
Binary: TypeAlias = Callable[[Builder, Size, Value, Value], Value]


def ones(size: Size) -> int:
    """Return a mask of all bits of an operand."""
    return 0xFF if size == 1 else 0xFFFF


def adder(m: Builder, size: Size, a: Value, b: Value, carry: Value, sticky: bool = False) -> Value:
    """Return a + b + carry and set all five flags. With ``sticky``, Z can only be cleared (isa.md §6.1)."""
    bits, half = 8 * size, 4 * size
    total = m.let(a + b + carry)
    apart = a ^ b  # the sum without carries
    result = m.let(total & ones(size))
    zero = result == 0
    m.set_flags(
        DC=(apart ^ total) >> half & 1,
        N=result >> bits - 1,
        OV=(~apart & (a ^ result)) >> bits - 1 & 1,
        Z=m.flag("Z") & zero if sticky else zero,
        C=total >> bits,
    )
    return result


def add(m: Builder, size: Size, a: Value, b: Value) -> Value:
    return adder(m, size, a, b, 0)


def addc(m: Builder, size: Size, a: Value, b: Value) -> Value:
    return adder(m, size, a, b, m.flag("C"), sticky=True)


def sub(m: Builder, size: Size, a: Value, b: Value) -> Value:
    return adder(m, size, a, b ^ ones(size), 1)


def subb(m: Builder, size: Size, a: Value, b: Value) -> Value:
    return adder(m, size, a, b ^ ones(size), m.flag("C"), sticky=True)


def subr(m: Builder, size: Size, a: Value, b: Value) -> Value:
    return sub(m, size, b, a)


def subbr(m: Builder, size: Size, a: Value, b: Value) -> Value:
    return subb(m, size, b, a)


def set_nz(m: Builder, size: Size, result: Value) -> Value:
    """Set N and Z by the result and return it."""
    m.set_flags(N=result >> 8 * size - 1, Z=result == 0)
    return result


def and_(m: Builder, size: Size, a: Value, b: Value) -> Value:
    return set_nz(m, size, m.let(a & b))


def xor(m: Builder, size: Size, a: Value, b: Value) -> Value:
    return set_nz(m, size, m.let(a ^ b))


def ior(m: Builder, size: Size, a: Value, b: Value) -> Value:
    return set_nz(m, size, m.let(a | b))


def test(m: Builder, size: Size, a: Value) -> Value:
    """Return the operand and set N and Z, as MOV f does."""
    return set_nz(m, size, a)


def inc(m: Builder, size: Size, a: Value) -> Value:
    return adder(m, size, a, 1, 0)


def inc2(m: Builder, size: Size, a: Value) -> Value:
    return adder(m, size, a, 2, 0)


def dec(m: Builder, size: Size, a: Value) -> Value:
    return sub(m, size, a, 1)


def dec2(m: Builder, size: Size, a: Value) -> Value:
    return sub(m, size, a, 2)


def neg(m: Builder, size: Size, a: Value) -> Value:
    return sub(m, size, 0, a)


def compare0(m: Builder, size: Size, a: Value) -> Value:
    """Subtract 0: C and DC become 1, OV 0 (isa.md §6.1)."""
    return sub(m, size, a, 0)


def com(m: Builder, size: Size, a: Value) -> Value:
    return set_nz(m, size, m.let(a ^ ones(size)))


def sl(m: Builder, size: Size, a: Value) -> Value:
    m.set_flags(C=a >> 8 * size - 1)
    return set_nz(m, size, m.let(a << 1 & ones(size)))


def lsr(m: Builder, size: Size, a: Value) -> Value:
    m.set_flags(C=a & 1)
    return set_nz(m, size, m.let(a >> 1))


def asr(m: Builder, size: Size, a: Value) -> Value:
    m.set_flags(C=a & 1)
    return set_nz(m, size, m.let(a >> 1 | a & 1 << 8 * size - 1))


def rlnc(m: Builder, size: Size, a: Value) -> Value:
    return set_nz(m, size, m.let(a << 1 & ones(size) | a >> 8 * size - 1))


def rlc(m: Builder, size: Size, a: Value) -> Value:
    result = m.let(a << 1 & ones(size) | m.flag("C"))
    m.set_flags(C=a >> 8 * size - 1)
    return set_nz(m, size, result)


def rrnc(m: Builder, size: Size, a: Value) -> Value:
    return set_nz(m, size, m.let(a >> 1 | (a & 1) << 8 * size - 1))


def rrc(m: Builder, size: Size, a: Value) -> Value:
    result = m.let(a >> 1 | m.flag("C") << 8 * size - 1)
    m.set_flags(C=a & 1)
    return set_nz(m, size, result)
