"""The dsPIC30F3014 as data: a smaller 30F4013.

It has half of the flash, and no CAN, DCI, timers 4 and 5, IC7, IC8, OC3 and OC4.

Sources: processor id in ELF files: public XC16 files for this part and the vendor's list of parts (`members.py`).

UNVERIFIED, without access to the data sheet (DS70138): the device id, the sizes of flash and EEPROM, and everything
that `dspic30f4013` lists as UNVERIFIED.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from emu.chips.chip import load_sfrs
from emu.chips.dspic30f4013 import DSPIC30F4013
from emu.chips.family import interrupts_of, program_space, vectors_of

_SFRS: Final = load_sfrs(Path(__file__).with_name("registers.csv"))
_INTERRUPTS: Final = interrupts_of(_SFRS)

DSPIC30F3014: Final = replace(
    DSPIC30F4013,
    name="dsPIC30F3014",
    sfrs=_SFRS,
    vectors=vectors_of(_INTERRUPTS),
    interrupts=_INTERRUPTS,
    program=program_space(flash_end=0x4000, eeprom_bytes=0x400),
    device_id=0x0160,
    processors=(0x0D,),
    timers=DSPIC30F4013.timers[:3],
    captures=DSPIC30F4013.captures[:2],
    compares=DSPIC30F4013.compares[:2],
    dci=None,
    cans=(),
)
