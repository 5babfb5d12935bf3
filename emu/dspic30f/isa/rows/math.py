"""Arithmetic on W registers and file registers; decimal adjust and bit search (isa.md §5.1, §6.1, §6.4)."""

from __future__ import annotations

from emu.dspic30f.isa.addressing import source
from emu.dspic30f.isa.alu import add, addc, dec, dec2, inc, inc2, neg, sub, subb, subbr, subr
from emu.dspic30f.isa.builder import Builder
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.flow import Value
from emu.dspic30f.isa.forms import (
    f_and_wreg,
    f_and_wreg_to_wreg,
    f_only,
    f_to_wreg,
    source_to_destination,
    wb_and_literal,
    wb_and_source,
    wn_and_literal,
)
from emu.dspic30f.isa.row import Row


def decimal_adjust(m: Builder, x: Operands) -> None:
    """Correct the sum of two packed BCD bytes. Between the steps the sum has more than 8 bits."""
    v = m.w(x.s) & 0xFF
    v = m.let(v + 6 * ((v & 15 > 9) | m.flag("DC")))
    v = m.let(v + 0x60 * ((v > 0x9F) | m.flag("C")))
    m.set_flags(C=m.flag("C") | (v > 0xFF))
    m.set_wb(x.s, v)


def search(m: Builder, x: Operands, found: Value, carry: Value) -> None:
    m.set_flags(C=carry)
    m.set_w(x.d, found)


def first_one_left(m: Builder, x: Operands) -> None:
    v = m.let(source(m, x, 2).read())
    search(m, x, m.select(v == 0, 0, m.clz16(v) + 1), v == 0)


def first_one_right(m: Builder, x: Operands) -> None:
    v = m.let(source(m, x, 2).read())
    search(m, x, m.select(v == 0, 0, m.ctz16(v) + 1), v == 0)


def first_bit_change(m: Builder, x: Operands) -> None:
    """Store the negated number of consecutive bits below the sign bit that equal the sign bit."""
    v = m.let(source(m, x, 2).read())
    same = m.let(m.clz16(v ^ (v >> 15) * 0xFFFF) - 1)
    search(m, x, -same, same == 15)


# fmt: off
ROWS = (
    Row(1,   "ADD{.B} f",               "1011 0100 0B1f ffff ffff ffff", "DC N OV Z C",   f_and_wreg(add)),
    Row(2,   "ADD{.B} f, WREG",         "1011 0100 0B0f ffff ffff ffff", "DC N OV Z C",   f_and_wreg_to_wreg(add)),
    Row(3,   "ADD{.B} #lit10, Wn",      "1011 0000 0Bkk kkkk kkkk dddd", "DC N OV Z C",   wn_and_literal(add)),
    Row(4,   "ADD{.B} Wb, #lit5, Wd",   "0100 0www wBqq qddd d11k kkkk", "DC N OV Z C",   wb_and_literal(add)),
    Row(5,   "ADD{.B} Wb, Ws, Wd",      "0100 0www wBqq qddd dppp ssss", "DC N OV Z C",   wb_and_source(add)),
    Row(6,   "ADDC{.B} f",              "1011 0100 1B1f ffff ffff ffff", "DC N OV Z=s C", f_and_wreg(addc)),
    Row(7,   "ADDC{.B} f, WREG",        "1011 0100 1B0f ffff ffff ffff", "DC N OV Z=s C", f_and_wreg_to_wreg(addc)),
    Row(8,   "ADDC{.B} #lit10, Wn",     "1011 0000 1Bkk kkkk kkkk dddd", "DC N OV Z=s C", wn_and_literal(addc)),
    Row(9,   "ADDC{.B} Wb, #lit5, Wd",  "0100 1www wBqq qddd d11k kkkk", "DC N OV Z=s C", wb_and_literal(addc)),
    Row(10,  "ADDC{.B} Wb, Ws, Wd",     "0100 1www wBqq qddd dppp ssss", "DC N OV Z=s C", wb_and_source(addc)),
    Row(11,  "SUB{.B} f",               "1011 0101 0B1f ffff ffff ffff", "DC N OV Z C",   f_and_wreg(sub)),
    Row(12,  "SUB{.B} f, WREG",         "1011 0101 0B0f ffff ffff ffff", "DC N OV Z C",   f_and_wreg_to_wreg(sub)),
    Row(13,  "SUB{.B} #lit10, Wn",      "1011 0001 0Bkk kkkk kkkk dddd", "DC N OV Z C",   wn_and_literal(sub)),
    Row(14,  "SUB{.B} Wb, #lit5, Wd",   "0101 0www wBqq qddd d11k kkkk", "DC N OV Z C",   wb_and_literal(sub)),
    Row(15,  "SUB{.B} Wb, Ws, Wd",      "0101 0www wBqq qddd dppp ssss", "DC N OV Z C",   wb_and_source(sub)),
    Row(16,  "SUBB{.B} f",              "1011 0101 1B1f ffff ffff ffff", "DC N OV Z=s C", f_and_wreg(subb)),
    Row(17,  "SUBB{.B} f, WREG",        "1011 0101 1B0f ffff ffff ffff", "DC N OV Z=s C", f_and_wreg_to_wreg(subb)),
    Row(18,  "SUBB{.B} #lit10, Wn",     "1011 0001 1Bkk kkkk kkkk dddd", "DC N OV Z=s C", wn_and_literal(subb)),
    Row(19,  "SUBB{.B} Wb, #lit5, Wd",  "0101 1www wBqq qddd d11k kkkk", "DC N OV Z=s C", wb_and_literal(subb)),
    Row(20,  "SUBB{.B} Wb, Ws, Wd",     "0101 1www wBqq qddd dppp ssss", "DC N OV Z=s C", wb_and_source(subb)),
    Row(36,  "SUBR{.B} f",              "1011 1101 0B1f ffff ffff ffff", "DC N OV Z C",   f_and_wreg(subr)),
    Row(37,  "SUBR{.B} f, WREG",        "1011 1101 0B0f ffff ffff ffff", "DC N OV Z C",   f_and_wreg_to_wreg(subr)),
    Row(38,  "SUBR{.B} Wb, #lit5, Wd",  "0001 0www wBqq qddd d11k kkkk", "DC N OV Z C",   wb_and_literal(subr)),
    Row(39,  "SUBR{.B} Wb, Ws, Wd",     "0001 0www wBqq qddd dppp ssss", "DC N OV Z C",   wb_and_source(subr)),
    Row(40,  "SUBBR{.B} f",             "1011 1101 1B1f ffff ffff ffff", "DC N OV Z=s C", f_and_wreg(subbr)),
    Row(41,  "SUBBR{.B} f, WREG",       "1011 1101 1B0f ffff ffff ffff", "DC N OV Z=s C", f_and_wreg_to_wreg(subbr)),
    Row(42,  "SUBBR{.B} Wb, #lit5, Wd", "0001 1www wBqq qddd d11k kkkk", "DC N OV Z=s C", wb_and_literal(subbr)),
    Row(43,  "SUBBR{.B} Wb, Ws, Wd",    "0001 1www wBqq qddd dppp ssss", "DC N OV Z=s C", wb_and_source(subbr)),
    Row(53,  "INC{.B} f",               "1110 1100 0B1f ffff ffff ffff", "DC N OV Z C",   f_only(inc)),
    Row(54,  "INC{.B} f, WREG",         "1110 1100 0B0f ffff ffff ffff", "DC N OV Z C",   f_to_wreg(inc)),
    Row(55,  "INC{.B} Ws, Wd",          "1110 1000 0Bqq qddd dppp ssss", "DC N OV Z C",   source_to_destination(inc)),
    Row(56,  "INC2{.B} f",              "1110 1100 1B1f ffff ffff ffff", "DC N OV Z C",   f_only(inc2)),
    Row(57,  "INC2{.B} f, WREG",        "1110 1100 1B0f ffff ffff ffff", "DC N OV Z C",   f_to_wreg(inc2)),
    Row(58,  "INC2{.B} Ws, Wd",         "1110 1000 1Bqq qddd dppp ssss", "DC N OV Z C",   source_to_destination(inc2)),
    Row(59,  "DEC{.B} f",               "1110 1101 0B1f ffff ffff ffff", "DC N OV Z C",   f_only(dec)),
    Row(60,  "DEC{.B} f, WREG",         "1110 1101 0B0f ffff ffff ffff", "DC N OV Z C",   f_to_wreg(dec)),
    Row(61,  "DEC{.B} Ws, Wd",          "1110 1001 0Bqq qddd dppp ssss", "DC N OV Z C",   source_to_destination(dec)),
    Row(62,  "DEC2{.B} f",              "1110 1101 1B1f ffff ffff ffff", "DC N OV Z C",   f_only(dec2)),
    Row(63,  "DEC2{.B} f, WREG",        "1110 1101 1B0f ffff ffff ffff", "DC N OV Z C",   f_to_wreg(dec2)),
    Row(64,  "DEC2{.B} Ws, Wd",         "1110 1001 1Bqq qddd dppp ssss", "DC N OV Z C",   source_to_destination(dec2)),
    Row(65,  "NEG{.B} f",               "1110 1110 0B1f ffff ffff ffff", "DC N OV Z C",   f_only(neg)),
    Row(66,  "NEG{.B} f, WREG",         "1110 1110 0B0f ffff ffff ffff", "DC N OV Z C",   f_to_wreg(neg)),
    Row(67,  "NEG{.B} Ws, Wd",          "1110 1010 0Bqq qddd dppp ssss", "DC N OV Z C",   source_to_destination(neg)),
    Row(185, "DAW.B Wn",                "1111 1101 0100 0000 0000 ssss", "C",             decimal_adjust),
    Row(186, "FF1L Ws, Wnd",            "1100 1111 1000 0ddd dppp ssss", "C",             first_one_left),
    Row(187, "FF1R Ws, Wnd",            "1100 1111 0000 0ddd dppp ssss", "C",             first_one_right),
    Row(188, "FBCL Ws, Wnd",            "1101 1111 0000 0ddd dppp ssss", "C",             first_bit_change),
)
# fmt: on
