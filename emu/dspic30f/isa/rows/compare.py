"""Compare instructions (isa.md §5.2): set the flags of a subtraction. The CPSxx skips are in flow.py."""

from __future__ import annotations

from emu.dspic30f.isa.alu import compare0, sub, subb
from emu.dspic30f.isa.forms import f_flags, f_with_wreg, source_flags, wb_with_literal, wb_with_source
from emu.dspic30f.isa.row import Row

# fmt: off
ROWS = (
    Row(104, "CP{.B} f",          "1110 0011 0B0f ffff ffff ffff", "DC N OV Z C",   f_with_wreg(sub)),
    Row(105, "CP{.B} Wb, #lit5",  "1110 0001 0www wB00 011k kkkk", "DC N OV Z C",   wb_with_literal(sub)),
    Row(106, "CP{.B} Wb, Ws",     "1110 0001 0www wB00 0ppp ssss", "DC N OV Z C",   wb_with_source(sub)),
    Row(107, "CPB{.B} f",         "1110 0011 1B0f ffff ffff ffff", "DC N OV Z=s C", f_with_wreg(subb)),
    Row(108, "CPB{.B} Wb, #lit5", "1110 0001 1www wB00 011k kkkk", "DC N OV Z=s C", wb_with_literal(subb)),
    Row(109, "CPB{.B} Wb, Ws",    "1110 0001 1www wB00 0ppp ssss", "DC N OV Z=s C", wb_with_source(subb)),
    Row(110, "CP0{.B} f",         "1110 0010 0B0f ffff ffff ffff", "DC N OV Z C",   f_flags(compare0)),
    Row(111, "CP0{.B} Ws",        "1110 0000 0000 0B00 0ppp ssss", "DC N OV Z C",   source_flags(compare0)),
)
# fmt: on
