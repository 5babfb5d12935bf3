"""Bit operations (isa.md §5.4, §6.5). The f forms access the byte that holds the bit; the Ws forms a word or byte.

Ws is read and written at one EA, and its pointer is updated once. UNVERIFIED: for stalls this update is on the source
side (isa.md §13.2), and bit-reversed addressing, which concerns destination pointers, does not apply.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from emu.dspic30f.isa.addressing import size_of, source
from emu.dspic30f.isa.builder import Builder
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.flow import Value
from emu.dspic30f.isa.row import Does, Row

Change: TypeAlias = Callable[[Value, Value], Value]
Report: TypeAlias = Callable[[Builder, Value], None]


def set_bit(v: Value, mask: Value) -> Value:
    return v | mask


def clear_bit(v: Value, mask: Value) -> Value:
    return v & ~mask


def toggle_bit(v: Value, mask: Value) -> Value:
    return v ^ mask


def to_c(m: Builder, bit: Value) -> None:
    m.set_flags(C=bit)


def to_z(m: Builder, bit: Value) -> None:
    m.set_flags(Z=bit ^ 1)


def change_f_bit(change: Change) -> Does:
    """Return the function that changes bit b of byte f."""

    def does(m: Builder, x: Operands) -> None:
        m.store(x.f, change(m.load(x.f, 1), 1 << x.b), 1)

    return does


def change_bit(change: Change) -> Does:
    """Return the function that changes bit b of Ws."""

    def does(m: Builder, x: Operands) -> None:
        place = source(m, x, size_of(x))
        place.write(change(place.read(), 1 << x.b))

    return does


def test_f_bit(m: Builder, x: Operands) -> None:
    to_z(m, m.load(x.f, 1) >> x.b & 1)


def test_and_set_f_bit(m: Builder, x: Operands) -> None:
    v = m.let(m.load(x.f, 1))
    to_z(m, v >> x.b & 1)
    m.store(x.f, v | 1 << x.b, 1)


def test_bit(report: Report) -> Does:
    """Return the function that copies bit b of Ws to C or, inverted, to Z."""

    def does(m: Builder, x: Operands) -> None:
        report(m, source(m, x, 2).read() >> x.b & 1)

    return does


def test_bit_wb(report: Report) -> Does:
    """Return the function that copies bit Wb<3:0> of Ws to C or, inverted, to Z."""

    def does(m: Builder, x: Operands) -> None:
        number = m.w(x.w) & 15
        report(m, source(m, x, 2).read() >> number & 1)

    return does


def test_and_set_bit(report: Report) -> Does:
    """Return the function that tests bit b as ``test_bit`` and then sets it. It is written even if it was 1."""

    def does(m: Builder, x: Operands) -> None:
        place = source(m, x, 2)
        v = m.let(place.read())
        report(m, v >> x.b & 1)
        place.write(v | 1 << x.b)

    return does


def write_bit(flag: str, inverted: int) -> Does:
    """Return the function for bit Wb<3:0> of Ws <- C or !Z."""

    def does(m: Builder, x: Operands) -> None:
        number = m.let(m.w(x.w) & 15)
        place = source(m, x, 2)
        place.write(place.read() & ~(1 << number) | (m.flag(flag) ^ inverted) << number)

    return does


# fmt: off
ROWS = (
    Row(116, "BSET{.B} f, #bit4",  "1010 1000 bbbf ffff ffff ffff", "",  change_f_bit(set_bit)),
    Row(117, "BSET{.B} Ws, #bit4", "1010 0000 bbbb 0B00 0ppp ssss", "",  change_bit(set_bit)),
    Row(118, "BCLR{.B} f, #bit4",  "1010 1001 bbbf ffff ffff ffff", "",  change_f_bit(clear_bit)),
    Row(119, "BCLR{.B} Ws, #bit4", "1010 0001 bbbb 0B00 0ppp ssss", "",  change_bit(clear_bit)),
    Row(120, "BTG{.B} f, #bit4",   "1010 1010 bbbf ffff ffff ffff", "",  change_f_bit(toggle_bit)),
    Row(121, "BTG{.B} Ws, #bit4",  "1010 0010 bbbb 0B00 0ppp ssss", "",  change_bit(toggle_bit)),
    Row(122, "BTST{.B} f, #bit4",  "1010 1011 bbbf ffff ffff ffff", "Z", test_f_bit),
    Row(123, "BTST.C Ws, #bit4",   "1010 0011 bbbb 0000 0ppp ssss", "C", test_bit(to_c)),
    Row(124, "BTST.Z Ws, #bit4",   "1010 0011 bbbb 1000 0ppp ssss", "Z", test_bit(to_z)),
    Row(125, "BTST.C Ws, Wb",      "1010 0101 0www w000 0ppp ssss", "C", test_bit_wb(to_c)),
    Row(126, "BTST.Z Ws, Wb",      "1010 0101 1www w000 0ppp ssss", "Z", test_bit_wb(to_z)),
    Row(127, "BTSTS{.B} f, #bit4", "1010 1100 bbbf ffff ffff ffff", "Z", test_and_set_f_bit),
    Row(128, "BTSTS.C Ws, #bit4",  "1010 0100 bbbb 0000 0ppp ssss", "C", test_and_set_bit(to_c)),
    Row(129, "BTSTS.Z Ws, #bit4",  "1010 0100 bbbb 1000 0ppp ssss", "Z", test_and_set_bit(to_z)),
    Row(134, "BSW.C Ws, Wb",       "1010 1101 0www w000 0ppp ssss", "",  write_bit("C", 0)),
    Row(135, "BSW.Z Ws, Wb",       "1010 1101 1www w000 0ppp ssss", "",  write_bit("Z", 1)),
)
# fmt: on
