"""The dsPIC30F6012A as data: the 30F6014A in a package of 64 pins.

Sources: processor id in ELF files: the vendor's list of parts (`members.py`); memory sizes and peripherals: those of
the 30F6014A, with which the part shares its data sheet (DS70143).

The device id is in dspic30f6014a.md §1.2.

UNVERIFIED: the pins, where the package lacks port A and RC3, RC4, RD12-RD15, RF7 and RF8.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from emu.chips.chip import CaptureSite, SpiSite, TimerSite, load_sfrs
from emu.chips.dspic30f6014a import DSPIC30F6014A

_CAPTURES: Final = ("RD8", "RD9", "RD10", "RD11", "RD4", "RD5", "RB4", "RB5")

DSPIC30F6012A: Final = replace(
    DSPIC30F6014A,
    name="dsPIC30F6012A",
    sfrs=load_sfrs(Path(__file__).with_name("registers.csv")),
    device_id=0x02C2,
    processors=(0x1D,),
    ports=("B", "C", "D", "F", "G"),
    change_pins=DSPIC30F6014A.change_pins[:19],
    external_pins=(("RF6", 0), ("RD8", 16), ("RD9", 23), ("RD10", 36), ("RD11", 37)),
    timers=(
        *DSPIC30F6014A.timers[:3],
        TimerSite(4, "B", "", 21, 5),
        TimerSite(5, "C", "", 22, 4),
    ),
    spis=(SpiSite(1, "RF6", "RF2", "RF3", "RB2", 8), DSPIC30F6014A.spis[1]),
    captures=tuple(
        CaptureSite(site.number, pin, site.irq) for site, pin in zip(DSPIC30F6014A.captures, _CAPTURES, strict=True)
    ),
)
