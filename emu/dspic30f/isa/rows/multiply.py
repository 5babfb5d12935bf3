"""Multiply and divide instructions (isa.md §5.6, §6.6, §6.7)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

from emu.dspic30f.isa.addressing import set_register, signed16, size_of, source, truncated
from emu.dspic30f.isa.builder import Builder
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.flow import Value
from emu.dspic30f.isa.forms import WREG
from emu.dspic30f.isa.row import Does, Row

Reading: TypeAlias = Callable[[Builder, Value], Value]
Dividend: TypeAlias = Callable[[Builder, Operands], Value]

mul = partial(Row, constraints="d!=14")
DIVIDE_COUNT = 17
"""Count of the REPEAT before a divide, which has 18 steps (isa.md §6.7)."""

div = partial(Row, constraints="s>=2")
dvd = partial(Row, constraints="s>=2; v even; t=v+1")


def unsigned(m: Builder, v: Value) -> Value:
    return v


signed = signed16


def set_pair(m: Builder, low: int, v: Value) -> None:
    """Wn+1:Wn <- the low 32 bits of v."""
    m.set_w(low, v)
    m.set_w(low + 1, v >> 16)


def multiply(base: Reading, factor: Reading) -> Does:
    """Return the function for Wnd+1:Wnd <- Wb * Ws, each operand read as signed or unsigned."""

    def does(m: Builder, x: Operands) -> None:
        b = base(m, m.w(x.w))
        set_pair(m, x.d, m.let(b * factor(m, source(m, x, 2).read())))

    return does


def multiply_literal(base: Reading) -> Does:
    """Return the function for Wnd+1:Wnd <- Wb * lit5."""

    def does(m: Builder, x: Operands) -> None:
        set_pair(m, x.d, m.let(base(m, m.w(x.w)) * x.k))

    return does


def multiply_f(m: Builder, x: Operands) -> None:
    """W3:W2 <- f * WREG; in byte mode W2 <- f * WREG<7:0>. Unsigned."""
    size = size_of(x)
    wreg = truncated(m.w(WREG), size)
    v = m.let(m.load(x.f, size) * wreg)
    if x.B:
        set_register(m, 2, v, 2)
    else:
        set_pair(m, 2, v)


def unsigned_word(m: Builder, x: Operands) -> Value:
    return m.w(x.v)


def signed_word(m: Builder, x: Operands) -> Value:
    return signed16(m, m.w(x.v))


def unsigned_double(m: Builder, x: Operands) -> Value:
    return m.w(x.t) << 16 | m.w(x.v)


def signed_double(m: Builder, x: Operands) -> Value:
    return signed16(m, m.w(x.t)) << 16 | m.w(x.v)


def fraction(m: Builder, x: Operands) -> Value:
    return signed16(m, m.w(x.t)) << 15


def divide(dividend: Dividend, reading: Reading) -> Does:
    """Return the function for one of a divide's 18 steps under REPEAT.

    The first step checks for zero; the last writes W0, W1 and the flags.

    UNVERIFIED: the other steps change nothing; C ends as 0; after overflow W0 and W1 hold the low bits (isa.md §6.7).
    """

    def does(m: Builder, x: Operands) -> None:
        count = m.reg("RCOUNT")
        last = m.let(count == 0)
        old = m.w(0), m.w(1)
        n, d = m.let(dividend(m, x)), m.let(reading(m, m.w(x.s)))
        m.trap_math((d == 0) & (count == DIVIDE_COUNT))
        q, r = m.let(m.div_trunc(n, d)), m.let(m.rem_trunc(n, d))
        if reading is signed:
            overflow, negative = (q < -0x8000) | (q > 0x7FFF), r < 0
        else:
            overflow, negative = q > 0xFFFF, 0
        results = {"N": negative, "OV": overflow, "Z": r == 0, "C": 0}
        m.set_flags(**{name: m.select(last, v, m.flag(name)) for name, v in results.items()})
        m.set_w(0, m.select(last, q, old[0]))
        m.set_w(1, m.select(last, r, old[1]))

    return does


# fmt: off
ROWS = (
    Row(189, "MUL{.B} f",             "1011 1100 0B0f ffff ffff ffff", "",         multiply_f),
    mul(190, "MUL.SS Wb, Ws, Wnd",    "1011 1001 1www wddd 0ppp ssss", "",         multiply(signed, signed)),
    mul(191, "MUL.SU Wb, Ws, Wnd",    "1011 1001 0www wddd 0ppp ssss", "",         multiply(signed, unsigned)),
    mul(192, "MUL.SU Wb, #lit5, Wnd", "1011 1001 0www wddd 011k kkkk", "",         multiply_literal(signed)),
    mul(193, "MUL.US Wb, Ws, Wnd",    "1011 1000 1www wddd 0ppp ssss", "",         multiply(unsigned, signed)),
    mul(194, "MUL.UU Wb, Ws, Wnd",    "1011 1000 0www wddd 0ppp ssss", "",         multiply(unsigned, unsigned)),
    mul(195, "MUL.UU Wb, #lit5, Wnd", "1011 1000 0www wddd 011k kkkk", "",         multiply_literal(unsigned)),
    div(196, "DIV.S{W} Wm, Wn",       "1101 1000 0000 0vvv v000 ssss", "N OV Z C", divide(signed_word, signed)),
    dvd(197, "DIV.SD Wm, Wn",         "1101 1000 0ttt tvvv v100 ssss", "N OV Z C", divide(signed_double, signed)),
    div(198, "DIV.U{W} Wm, Wn",       "1101 1000 1000 0vvv v000 ssss", "N OV Z C", divide(unsigned_word, unsigned)),
    dvd(199, "DIV.UD Wm, Wn",         "1101 1000 1ttt tvvv v100 ssss", "N OV Z C", divide(unsigned_double, unsigned)),
    div(200, "DIVF Wm, Wn",           "1101 1001 0ttt t000 0000 ssss", "N OV Z C", divide(fraction, signed)),
)
# fmt: on
