"""Operand forms: functions that make a row's ``does`` from an operation, in the phase order of builder.py.

A form's name lists its operands and destination, as in the syntax column of the table.
"""

from __future__ import annotations

from .addressing import destination, set_register, size_of, source, truncated
from .alu import Binary, Unary, ones
from .builder import Builder
from .fields import Operands
from .row import Does

WREG = 0  # W0 is WREG of file-register instructions (isa.md §2.2)


def f_and_wreg(op: Binary) -> Does:
    """Return the function for f <- f op WREG."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        wreg = truncated(m.w(WREG), size)
        m.store(x.f, op(m, size, m.load(x.f, size), wreg), size)

    return does


def f_and_wreg_to_wreg(op: Binary) -> Does:
    """Return the function for WREG <- f op WREG."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        wreg = truncated(m.w(WREG), size)
        set_register(m, WREG, op(m, size, m.load(x.f, size), wreg), size)

    return does


def f_with_wreg(op: Binary) -> Does:
    """Return the function that sets the flags of f op WREG."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        wreg = truncated(m.w(WREG), size)
        op(m, size, m.load(x.f, size), wreg)

    return does


def f_only(op: Unary) -> Does:
    """Return the function for f <- op f."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        m.store(x.f, op(m, size, m.load(x.f, size)), size)

    return does


def f_to_wreg(op: Unary) -> Does:
    """Return the function for WREG <- op f."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        set_register(m, WREG, op(m, size, m.load(x.f, size)), size)

    return does


def f_flags(op: Unary) -> Does:
    """Return the function that sets the flags of op f."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        op(m, size, m.load(x.f, size))

    return does


def wn_and_literal(op: Binary) -> Does:
    """Return the function for Wn <- Wn op lit10."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        set_register(m, x.d, op(m, size, truncated(m.w(x.d), size), x.k), size)

    return does


def wb_and_literal(op: Binary) -> Does:
    """Return the function for Wd <- Wb op lit5."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        base = truncated(m.w(x.w), size)
        destination(m, x, size).write(op(m, size, base, x.k))

    return does


def wb_and_source(op: Binary) -> Does:
    """Return the function for Wd <- Wb op Ws."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        base = truncated(m.w(x.w), size)
        operand = source(m, x, size)
        result = destination(m, x, size)
        result.write(op(m, size, base, operand.read()))

    return does


def source_to_destination(op: Unary) -> Does:
    """Return the function for Wd <- op Ws."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        operand = source(m, x, size)
        result = destination(m, x, size)
        result.write(op(m, size, operand.read()))

    return does


def wb_with_literal(op: Binary) -> Does:
    """Return the function that sets the flags of Wb op lit5."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        op(m, size, truncated(m.w(x.w), size), x.k)

    return does


def wb_with_source(op: Binary) -> Does:
    """Return the function that sets the flags of Wb op Ws."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        base = truncated(m.w(x.w), size)
        op(m, size, base, source(m, x, size).read())

    return does


def source_flags(op: Unary) -> Does:
    """Return the function that sets the flags of op Ws."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        op(m, size, source(m, x, size).read())

    return does


def f_constant(bits: int) -> Does:
    """Return the function for f <- all zeros or all ones, without reading it."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        m.store(x.f, bits & ones(size), size)

    return does


def wreg_constant(bits: int) -> Does:
    """Return the function for WREG <- all zeros or all ones."""

    def does(m: Builder, x: Operands) -> None:
        set_register(m, WREG, bits & ones(size_of(x)), size_of(x))

    return does


def destination_constant(bits: int) -> Does:
    """Return the function for Wd <- all zeros or all ones."""

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        destination(m, x, size).write(bits & ones(size))

    return does
