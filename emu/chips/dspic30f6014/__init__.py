"""The dsPIC30F6014 as data: the 30F6014A's predecessor, with another clock selection and without CodeGuard.

Sources: device id 0x0198, flash and EEPROM: device tables of public programmers and boot loaders; processor id in ELF
files: the vendor's list of parts (`members.py`); fields of FOSC and OSCCON: those of the 30F4011, whose header is
public.

UNVERIFIED, without access to the data sheet (DS70117): pins, memory map and registers other than those of the clock and
of CodeGuard are the 30F6014A's.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from emu.chips.chip import load_sfrs
from emu.chips.dspic30f6014a import CONFIG, DSPIC30F6014A
from emu.chips.family import CLOCK_BY_FPR_WITHOUT_FRC_PLL, FGS_WITHOUT_SEGMENTS, FOSC_OF_FPR, config_words

DSPIC30F6014: Final = replace(
    DSPIC30F6014A,
    name="dsPIC30F6014",
    sfrs=load_sfrs(Path(__file__).with_name("registers.csv")),
    config=config_words(FOSC_OF_FPR, CONFIG["FWDT"], CONFIG["FBORPOR"], FGS_WITHOUT_SEGMENTS, CONFIG["FICD"]),
    device_id=0x0198,
    revision=0x1002,
    processors=(0x18,),
    clock=CLOCK_BY_FPR_WITHOUT_FRC_PLL,
)
