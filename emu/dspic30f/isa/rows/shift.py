"""Shift and rotate instructions (isa.md §5.3, §6.3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from emu.dspic30f.isa.addressing import signed16
from emu.dspic30f.isa.alu import asr, lsr, rlc, rlnc, rrc, rrnc, set_nz, sl
from emu.dspic30f.isa.builder import Builder
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.flow import Value
from emu.dspic30f.isa.forms import f_only, f_to_wreg, source_to_destination
from emu.dspic30f.isa.row import Does, Row

Shift: TypeAlias = Callable[[Builder, Value, Value], Value]


def left(m: Builder, v: Value, count: Value) -> Value:
    return v << count


def right(m: Builder, v: Value, count: Value) -> Value:
    return v >> count


def right_signed(m: Builder, v: Value, count: Value) -> Value:
    return signed16(m, v) >> count


def shift_by_register(shift: Shift) -> Does:
    """Return the function for Wnd <- Wb shifted by Wns<4:0>. C does not change.

    A shift by 16 or more leaves only zeros or sign bits.
    """

    def does(m: Builder, x: Operands) -> None:
        m.set_w(x.d, set_nz(m, 2, m.let(shift(m, m.w(x.w), m.w(x.s) & 31) & 0xFFFF)))

    return does


def shift_by_literal(shift: Shift) -> Does:
    """Return the function for Wnd <- Wb shifted by lit4. C does not change."""

    def does(m: Builder, x: Operands) -> None:
        m.set_w(x.d, set_nz(m, 2, m.let(shift(m, m.w(x.w), x.k) & 0xFFFF)))

    return does


# fmt: off
ROWS = (
    Row(71,  "SL{.B} f",               "1101 0100 0B1f ffff ffff ffff", "N Z C", f_only(sl)),
    Row(72,  "SL{.B} f, WREG",         "1101 0100 0B0f ffff ffff ffff", "N Z C", f_to_wreg(sl)),
    Row(73,  "SL{.B} Ws, Wd",          "1101 0000 0Bqq qddd dppp ssss", "N Z C", source_to_destination(sl)),
    Row(74,  "LSR{.B} f",              "1101 0101 0B1f ffff ffff ffff", "N Z C", f_only(lsr)),
    Row(75,  "LSR{.B} f, WREG",        "1101 0101 0B0f ffff ffff ffff", "N Z C", f_to_wreg(lsr)),
    Row(76,  "LSR{.B} Ws, Wd",         "1101 0001 0Bqq qddd dppp ssss", "N Z C", source_to_destination(lsr)),
    Row(77,  "ASR{.B} f",              "1101 0101 1B1f ffff ffff ffff", "N Z C", f_only(asr)),
    Row(78,  "ASR{.B} f, WREG",        "1101 0101 1B0f ffff ffff ffff", "N Z C", f_to_wreg(asr)),
    Row(79,  "ASR{.B} Ws, Wd",         "1101 0001 1Bqq qddd dppp ssss", "N Z C", source_to_destination(asr)),
    Row(80,  "RLNC{.B} f",             "1101 0110 0B1f ffff ffff ffff", "N Z",   f_only(rlnc)),
    Row(81,  "RLNC{.B} f, WREG",       "1101 0110 0B0f ffff ffff ffff", "N Z",   f_to_wreg(rlnc)),
    Row(82,  "RLNC{.B} Ws, Wd",        "1101 0010 0Bqq qddd dppp ssss", "N Z",   source_to_destination(rlnc)),
    Row(83,  "RLC{.B} f",              "1101 0110 1B1f ffff ffff ffff", "N Z C", f_only(rlc)),
    Row(84,  "RLC{.B} f, WREG",        "1101 0110 1B0f ffff ffff ffff", "N Z C", f_to_wreg(rlc)),
    Row(85,  "RLC{.B} Ws, Wd",         "1101 0010 1Bqq qddd dppp ssss", "N Z C", source_to_destination(rlc)),
    Row(86,  "RRNC{.B} f",             "1101 0111 0B1f ffff ffff ffff", "N Z",   f_only(rrnc)),
    Row(87,  "RRNC{.B} f, WREG",       "1101 0111 0B0f ffff ffff ffff", "N Z",   f_to_wreg(rrnc)),
    Row(88,  "RRNC{.B} Ws, Wd",        "1101 0011 0Bqq qddd dppp ssss", "N Z",   source_to_destination(rrnc)),
    Row(89,  "RRC{.B} f",              "1101 0111 1B1f ffff ffff ffff", "N Z C", f_only(rrc)),
    Row(90,  "RRC{.B} f, WREG",        "1101 0111 1B0f ffff ffff ffff", "N Z C", f_to_wreg(rrc)),
    Row(91,  "RRC{.B} Ws, Wd",         "1101 0011 1Bqq qddd dppp ssss", "N Z C", source_to_destination(rrc)),
    Row(98,  "SL{.W} Wb, Wns, Wnd",    "1101 1101 0www wddd d000 ssss", "N Z",   shift_by_register(left)),
    Row(99,  "SL{.W} Wb, #lit4, Wnd",  "1101 1101 0www wddd d100 kkkk", "N Z",   shift_by_literal(left)),
    Row(100, "LSR{.W} Wb, Wns, Wnd",   "1101 1110 0www wddd d000 ssss", "N Z",   shift_by_register(right)),
    Row(101, "LSR{.W} Wb, #lit4, Wnd", "1101 1110 0www wddd d100 kkkk", "N Z",   shift_by_literal(right)),
    Row(102, "ASR{.W} Wb, Wns, Wnd",   "1101 1110 1www wddd d000 ssss", "N Z",   shift_by_register(right_signed)),
    Row(103, "ASR{.W} Wb, #lit4, Wnd", "1101 1110 1www wddd d100 kkkk", "N Z",   shift_by_literal(right_signed)),
)
# fmt: on
