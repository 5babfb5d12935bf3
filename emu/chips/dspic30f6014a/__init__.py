"""The dsPIC30F6014A as data. Sources: dspic30f6014a.md (sections cited), registers.csv, abi-elf.md §2.7, isa.md §14.

Registers are in `registers.csv` beside this file.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from emu.chips.chip import (
    AdcSite,
    CanSite,
    CaptureSite,
    Chip,
    CompareSite,
    ConfigWord,
    DciSite,
    I2cSite,
    Sfr,
    SpiSite,
    TimerSite,
    UartSite,
    load_sfrs,
)
from emu.chips.family import (
    CLOCK_BY_FOS,
    FOSC_OF_FOS,
    config_word,
    config_words,
    data_space,
    interrupts_of,
    program_space,
    vectors_of,
)

SFRS: Final[Mapping[str, Sfr]] = load_sfrs(Path(__file__).with_name("registers.csv"))
"""Every register by its data-sheet name, in address order."""

INTERRUPTS: Final = interrupts_of(SFRS)
"""Implemented interrupt sources by number (§5.2)."""

VECTORS: Final = vectors_of(INTERRUPTS)

CONFIG: Final[Mapping[str, ConfigWord]] = config_words(  # §2
    FOSC_OF_FOS,
    config_word("FWDT", 0xF80002, 0x803F, FWDTEN=(15, 1), FWPSA=(4, 2), FWPSB=(0, 4)),
    config_word("FBORPOR", 0xF80004, 0x87B3, MCLREN=(15, 1), BOREN=(7, 1), BORV=(4, 2), FPWRT=(0, 2)),
    config_word("FBS", 0xF80006, 0x310F, RBS=(12, 2), EBS=(8, 1), BSS=(1, 3), BWRP=(0, 1)),
    config_word("FSS", 0xF80008, 0x330F, RSS=(12, 2), ESS=(8, 2), SSS=(1, 3), SWRP=(0, 1)),
    config_word("FGS", 0xF8000A, 0x0007, GSS=(1, 2), GWRP=(0, 1)),
    config_word("FICD", 0xF8000C, 0xC003, BKBUG=(15, 1), COE=(14, 1), ICS=(0, 2)),
)

_CHANGE_PINS: Final = (  # §6.2
    "RC14 RC13 RB0 RB1 RB2 RB3 RB4 RB5 RG6 RG7 RG8 RG9 RB15 RD4 RD5 RD6 RD7 RF4 RF5 RD13 RD14 RD15 RA6 RA7"
)

DSPIC30F6014A: Final = Chip(
    name="dsPIC30F6014A",
    sfrs=SFRS,
    vectors=VECTORS,
    interrupts=INTERRUPTS,
    config=CONFIG,
    data=data_space(y_start=0x1800, ram_end=0x2800),  # §1.1
    program=program_space(flash_end=0x018000, eeprom_bytes=0x1000),  # §1.2
    device_id=0x02C3,
    revision=0x1002,  # UNVERIFIED: process and revision nibbles differ per silicon (§1.2)
    processors=(0x1F,),  # abi-elf.md §6.1
    ports=("A", "B", "C", "D", "F", "G"),  # §6
    change_pins=tuple(_CHANGE_PINS.split()),
    external_pins=(("RF6", 0), ("RA12", 16), ("RA13", 23), ("RA14", 36), ("RA15", 37)),  # §5.5
    timers=(  # §7
        TimerSite(1, "A", "RC14", 3, 0),
        TimerSite(2, "B", "RC1", 6, 3),
        TimerSite(3, "C", "RC2", 7, 2),
        TimerSite(4, "B", "RC3", 21, 5),
        TimerSite(5, "C", "RC4", 22, 4),
    ),
    uarts=(UartSite(1, "RF3", "RF2", 9, 10, 1), UartSite(2, "RF5", "RF4", 24, 25, 2)),  # §10
    spis=(  # §12
        SpiSite(1, "RF6", "RF7", "RF8", "RB2", 8),
        SpiSite(2, "RG6", "RG7", "RG8", "RG9", 26),
    ),
    i2c=I2cSite("RG3", "RG2", 13, 14),  # §11
    captures=tuple(  # §8
        CaptureSite(number, f"RD{7 + number}", irq)
        for number, irq in enumerate((1, 4, 28, 29, 30, 31, 17, 18), start=1)
    ),
    compares=tuple(  # §9
        CompareSite(number, f"RD{number - 1}", "RB6" if number <= 4 else "RB15", irq)
        for number, irq in enumerate((2, 5, 19, 20, 32, 33, 34, 35), start=1)
    ),
    adc=AdcSite(tuple(f"RB{channel}" for channel in range(16)), 11),  # §13
    dci=DciSite("RG12", "RG13", "RG14", "RG15", 41),  # §14
    cans=(CanSite(1, "RF0", "RF1", 27), CanSite(2, "RG0", "RG1", 38)),  # §15
    clock=CLOCK_BY_FOS,  # §2
    nvm_irq=12,  # §16
    lvd_irq=42,  # §17
)
