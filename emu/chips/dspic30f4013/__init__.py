"""The dsPIC30F4013 as data: 40 pins, 48 KB of flash, 2 KB of RAM.

Sources:
- device id 0x0141, 16 K instruction words of flash, 1 KB of EEPROM: device tables of public programmers and boot
  loaders, which agree;
- names of ports and pins (RA11, RB0-RB12, RD8 for IC1, RF2/RF3 for UART1, RF4/RF5 for UART2, boot loader at 0x7E00):
  public programs for this part;
- register addresses and bits: those of the family (registers.csv), for the devices that this part has.

- processor id in ELF files: public XC16 files for this part and the vendor's list of parts (`members.py`).

UNVERIFIED, without access to the data sheet (DS70138): the pins of CNx, the DCI's and OCFA's pins, the absence of T3CK
to T5CK, the start of Y RAM (that of the 30F4011, which has as much RAM), the fields of FOSC (those of the A parts) and
FGS.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from emu.chips.chip import (
    AdcSite,
    CanSite,
    CaptureSite,
    Chip,
    CompareSite,
    DciSite,
    I2cSite,
    SpiSite,
    TimerSite,
    UartSite,
    load_sfrs,
)
from emu.chips.family import (
    CLOCK_BY_FOS,
    FGS_WITHOUT_SEGMENTS,
    FOSC_OF_FOS,
    config_word,
    config_words,
    data_space,
    interrupts_of,
    program_space,
    vectors_of,
)

_SFRS: Final = load_sfrs(Path(__file__).with_name("registers.csv"))
_INTERRUPTS: Final = interrupts_of(_SFRS)

DSPIC30F4013: Final = Chip(
    name="dsPIC30F4013",
    sfrs=_SFRS,
    vectors=vectors_of(_INTERRUPTS),
    interrupts=_INTERRUPTS,
    config=config_words(
        FOSC_OF_FOS,
        config_word("FWDT", 0xF80002, 0x803F, FWDTEN=(15, 1), FWPSA=(4, 2), FWPSB=(0, 4)),
        config_word("FBORPOR", 0xF80004, 0x80B3, MCLREN=(15, 1), BOREN=(7, 1), BORV=(4, 2), FPWRT=(0, 2)),
        FGS_WITHOUT_SEGMENTS,
        config_word("FICD", 0xF8000C, 0xC003, BKBUG=(15, 1), COE=(14, 1), ICS=(0, 2)),
    ),
    data=data_space(y_start=0x0C00, ram_end=0x1000),
    program=program_space(flash_end=0x8000, eeprom_bytes=0x400),
    device_id=0x0141,
    revision=0x1002,  # UNVERIFIED
    processors=(0x0E,),
    ports=("A", "B", "C", "D", "F"),
    change_pins=("RC14", "RC13", *(f"RB{bit}" for bit in range(6)), *[""] * 9, "RF4", "RF5"),
    external_pins=(("RA11", 0), ("RD8", 16), ("RD9", 23)),
    timers=(
        TimerSite(1, "A", "RC14", 3, 0),
        TimerSite(2, "B", "RC13", 6, 3),
        TimerSite(3, "C", "", 7, 2),
        TimerSite(4, "B", "", 21, 5),
        TimerSite(5, "C", "", 22, 4),
    ),
    uarts=(UartSite(1, "RF3", "RF2", 9, 10, 1), UartSite(2, "RF5", "RF4", 24, 25, 2)),
    spis=(SpiSite(1, "RF6", "RF2", "RF3", "RB2", 8),),
    i2c=I2cSite("RF2", "RF3", 13, 14),
    captures=tuple(
        CaptureSite(number, pin, irq)
        for number, pin, irq in ((1, "RD8", 1), (2, "RD9", 4), (7, "RB4", 17), (8, "RB5", 18))
    ),
    compares=tuple(
        CompareSite(number, f"RD{number - 1}", "RB6", irq) for number, irq in ((1, 2), (2, 5), (3, 19), (4, 20))
    ),
    adc=AdcSite(tuple(f"RB{channel}" for channel in range(13)), 11),
    dci=DciSite("RB10", "RB11", "RB9", "RB12", 41),
    cans=(CanSite(1, "RF0", "RF1", 27),),
    clock=CLOCK_BY_FOS,
    nvm_irq=12,
    lvd_irq=42,
)
