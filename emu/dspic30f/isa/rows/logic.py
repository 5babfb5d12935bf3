"""Logic, clear and set instructions (isa.md §5.1, §6.2)."""

from __future__ import annotations

from emu.dspic30f.isa.alu import and_, com, ior, xor
from emu.dspic30f.isa.forms import (
    destination_constant,
    f_and_wreg,
    f_and_wreg_to_wreg,
    f_constant,
    f_only,
    f_to_wreg,
    source_to_destination,
    wb_and_literal,
    wb_and_source,
    wn_and_literal,
    wreg_constant,
)
from emu.dspic30f.isa.row import Row

# fmt: off
ROWS = (
    Row(21,  "AND{.B} f",             "1011 0110 0B1f ffff ffff ffff", "N Z", f_and_wreg(and_)),
    Row(22,  "AND{.B} f, WREG",       "1011 0110 0B0f ffff ffff ffff", "N Z", f_and_wreg_to_wreg(and_)),
    Row(23,  "AND{.B} #lit10, Wn",    "1011 0010 0Bkk kkkk kkkk dddd", "N Z", wn_and_literal(and_)),
    Row(24,  "AND{.B} Wb, #lit5, Wd", "0110 0www wBqq qddd d11k kkkk", "N Z", wb_and_literal(and_)),
    Row(25,  "AND{.B} Wb, Ws, Wd",    "0110 0www wBqq qddd dppp ssss", "N Z", wb_and_source(and_)),
    Row(26,  "XOR{.B} f",             "1011 0110 1B1f ffff ffff ffff", "N Z", f_and_wreg(xor)),
    Row(27,  "XOR{.B} f, WREG",       "1011 0110 1B0f ffff ffff ffff", "N Z", f_and_wreg_to_wreg(xor)),
    Row(28,  "XOR{.B} #lit10, Wn",    "1011 0010 1Bkk kkkk kkkk dddd", "N Z", wn_and_literal(xor)),
    Row(29,  "XOR{.B} Wb, #lit5, Wd", "0110 1www wBqq qddd d11k kkkk", "N Z", wb_and_literal(xor)),
    Row(30,  "XOR{.B} Wb, Ws, Wd",    "0110 1www wBqq qddd dppp ssss", "N Z", wb_and_source(xor)),
    Row(31,  "IOR{.B} f",             "1011 0111 0B1f ffff ffff ffff", "N Z", f_and_wreg(ior)),
    Row(32,  "IOR{.B} f, WREG",       "1011 0111 0B0f ffff ffff ffff", "N Z", f_and_wreg_to_wreg(ior)),
    Row(33,  "IOR{.B} #lit10, Wn",    "1011 0011 0Bkk kkkk kkkk dddd", "N Z", wn_and_literal(ior)),
    Row(34,  "IOR{.B} Wb, #lit5, Wd", "0111 0www wBqq qddd d11k kkkk", "N Z", wb_and_literal(ior)),
    Row(35,  "IOR{.B} Wb, Ws, Wd",    "0111 0www wBqq qddd dppp ssss", "N Z", wb_and_source(ior)),
    Row(68,  "COM{.B} f",             "1110 1110 1B1f ffff ffff ffff", "N Z", f_only(com)),
    Row(69,  "COM{.B} f, WREG",       "1110 1110 1B0f ffff ffff ffff", "N Z", f_to_wreg(com)),
    Row(70,  "COM{.B} Ws, Wd",        "1110 1010 1Bqq qddd dppp ssss", "N Z", source_to_destination(com)),
    Row(92,  "CLR{.B} f",             "1110 1111 0B1f ffff ffff ffff", "",    f_constant(0)),
    Row(93,  "CLR{.B} WREG",          "1110 1111 0B0z zzzz zzzz zzzz", "",    wreg_constant(0)),
    Row(94,  "CLR{.B} Wd",            "1110 1011 0Bqq qddd d000 0000", "",    destination_constant(0)),
    Row(95,  "SETM{.B} f",            "1110 1111 1B1f ffff ffff ffff", "",    f_constant(-1)),
    Row(96,  "SETM{.B} WREG",         "1110 1111 1B0z zzzz zzzz zzzz", "",    wreg_constant(-1)),
    Row(97,  "SETM{.B} Wd",           "1110 1011 1Bqq qddd d000 0000", "",    destination_constant(-1)),
)
# fmt: on
