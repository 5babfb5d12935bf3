"""The dsPIC30F4011 as data: 40 pins, motor control PWM, quadrature encoder interface, 10-bit ADC.

Sources:
- register addresses, bit fields, memory sizes, the start of Y RAM and the codes of FOSC and FBORPOR: the vendor's
  linker script p30f4011.gld and header p30f4011.h, which public projects contain;
- device id 0x0101 and EEPROM: device tables of public boot loaders;
- processor id in ELF files: the vendor's list of parts (`members.py`);
- devices: data sheet DS70135G.

UNVERIFIED: the assignment of devices to pins (pin diagram of DS70135G, quoted from memory), and the reset values of
PTPER, MAXCNT and OVDCON.
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
    I2cSite,
    PwmSite,
    QeiSite,
    SpiSite,
    TimerSite,
    UartSite,
    load_sfrs,
)
from emu.chips.family import (
    CLOCK_BY_FPR,
    FGS_WITHOUT_SEGMENTS,
    FOSC_OF_FPR,
    config_word,
    config_words,
    data_space,
    interrupts_of,
    program_space,
    vectors_of,
)

_SFRS: Final = load_sfrs(Path(__file__).with_name("registers.csv"))
_INTERRUPTS: Final = interrupts_of(_SFRS)

DSPIC30F4011: Final = Chip(
    name="dsPIC30F4011",
    sfrs=_SFRS,
    vectors=vectors_of(_INTERRUPTS),
    interrupts=_INTERRUPTS,
    config=config_words(
        FOSC_OF_FPR,
        config_word("FWDT", 0xF80002, 0x803F, FWDTEN=(15, 1), FWPSA=(4, 2), FWPSB=(0, 4)),
        config_word(
            "FBORPOR",
            0xF80004,
            0x87B3,
            MCLREN=(15, 1),
            PWMPIN=(10, 1),
            HPOL=(9, 1),
            LPOL=(8, 1),
            BOREN=(7, 1),
            BORV=(4, 2),
            FPWRT=(0, 2),
        ),
        FGS_WITHOUT_SEGMENTS,
        config_word("FICD", 0xF8000C, 0xC003, BKBUG=(15, 1), COE=(14, 1), ICS=(0, 2)),
    ),
    data=data_space(y_start=0x0C00, ram_end=0x1000),
    program=program_space(flash_end=0x8000, eeprom_bytes=0x400),
    device_id=0x0101,
    revision=0x1002,
    processors=(0x05,),
    ports=("B", "C", "D", "E", "F"),
    change_pins=("RC14", "RC13", *(f"RB{bit}" for bit in range(6)), *[""] * 9, "RF4", "RF5"),
    external_pins=(("RE8", 0), ("RD0", 16), ("RD1", 23)),
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
        for number, pin, irq in ((1, "RD0", 1), (2, "RD1", 4), (7, "RB4", 17), (8, "RB5", 18))
    ),
    compares=tuple(
        CompareSite(number, f"RD{number - 1}", "RB6", irq) for number, irq in ((1, 2), (2, 5), (3, 19), (4, 20))
    ),
    adc=AdcSite(tuple(f"RB{channel}" for channel in range(9)), 11, bits=10, conversion=12),
    dci=None,
    cans=(CanSite(1, "RF0", "RF1", 27),),
    clock=CLOCK_BY_FPR,
    nvm_irq=12,
    lvd_irq=None,
    pwm=PwmSite((("RE0", "RE1"), ("RE2", "RE3"), ("RE4", "RE5")), "RE8", 39, 43),
    qei=QeiSite("RB4", "RB5", "RB3", 40),
)
