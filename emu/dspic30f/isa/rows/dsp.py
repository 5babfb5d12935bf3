"""DSP instructions (isa.md §5.10, §8). UNVERIFIED: MPY.N sets flags as MPY does (isa.md §22 item 20)."""

from __future__ import annotations

from functools import partial

from emu.dspic30f.isa.dsp import (
    clear_accumulator,
    euclidean,
    literal_count,
    load_accumulator,
    mac_class,
    minus,
    negate,
    on_accumulators,
    opposite,
    plus,
    register_count,
    replace,
    shift_accumulator,
    store_accumulator,
)
from emu.dspic30f.isa.row import Row

ACC = "OA OB SA SB"  # flags of the addressed accumulator

sft = partial(Row, constraints="k>=-16; k<=16")
mac = partial(Row, psv_class="mov")
two = partial(mac, constraints="i!=4; j!=4")  # both prefetches are needed
square = partial(mac_class, square=True, write_back=False)
mpy = partial(mac_class, write_back=False)


# fmt: off
ROWS = (
    Row(44,  "ADD Acc",               "1100 1011 A000 0000 0000 0000", ACC, on_accumulators(plus)),
    Row(45,  "SUB Acc",               "1100 1011 A011 0000 0000 0000", ACC, on_accumulators(minus)),
    Row(46,  "NEG Acc",               "1100 1011 A001 0000 0000 0000", ACC, on_accumulators(opposite)),
    Row(47,  "ADD Ws, #Slit4, Acc",   "1100 1001 Awww wrrr rggg ssss", ACC, load_accumulator(plus)),
    Row(48,  "LAC Ws, #Slit4, Acc",   "1100 1010 Awww wrrr rggg ssss", ACC, load_accumulator(replace)),
    Row(49,  "SAC Acc, #Slit4, Wd",   "1100 1100 Awww wrrr rhhh dddd", "",  store_accumulator(rounding=False)),
    Row(50,  "SAC.R Acc, #Slit4, Wd", "1100 1101 Awww wrrr rhhh dddd", "",  store_accumulator(rounding=True)),
    sft(51,  "SFTAC Acc, #Slit6",     "1100 1000 A000 0000 01kk kkkk", ACC, shift_accumulator(literal_count)),
    Row(52,  "SFTAC Acc, Wb",         "1100 1000 A000 0000 0000 ssss", ACC, shift_accumulator(register_count)),
    mac(221, "MAC Wm*Wn, Acc {,[Wx],Wxd} {,[Wy],Wyd} {,AWB}", "1100 0mmm A0xx yyii iijj jjaa", ACC, mac_class(plus)),
    mac(222, "MAC Wm*Wm, Acc {,[Wx],Wxd} {,[Wy],Wyd}",        "1111 00mm A0xx yyii iijj jj00", ACC, square(plus)),
    mac(223, "MSC Wm*Wn, Acc {,[Wx],Wxd} {,[Wy],Wyd} {,AWB}", "1100 0mmm A1xx yyii iijj jjaa", ACC, mac_class(minus)),
    mac(224, "MPY Wm*Wn, Acc {,[Wx],Wxd} {,[Wy],Wyd}",        "1100 0mmm A0xx yyii iijj jj11", ACC, mpy(replace)),
    mac(225, "MPY Wm*Wm, Acc {,[Wx],Wxd} {,[Wy],Wyd}",        "1111 00mm A0xx yyii iijj jj01", ACC, square(replace)),
    mac(226, "MPY.N Wm*Wn, Acc {,[Wx],Wxd} {,[Wy],Wyd}",      "1100 0mmm A1xx yyii iijj jj11", ACC, mpy(negate)),
    mac(227, "CLR Acc {,[Wx],Wxd} {,[Wy],Wyd} {,AWB}",        "1100 0011 A0xx yyii iijj jjaa", ACC, clear_accumulator),
    mac(228, "MOVSAC Acc {,[Wx],Wxd} {,[Wy],Wyd} {,AWB}",     "1100 0111 A0xx yyii iijj jjaa", "",  mac_class(None)),
    two(229, "ED Wm*Wm, Acc, [Wx], [Wy], Wxd",                "1111 00mm A1xx 00ii iijj jj11", ACC, euclidean(replace)),
    two(230, "EDAC Wm*Wm, Acc, [Wx], [Wy], Wxd",              "1111 00mm A1xx 00ii iijj jj10", ACC, euclidean(plus)),
)
# fmt: on
