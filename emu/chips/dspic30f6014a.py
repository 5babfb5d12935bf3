"""The dsPIC30F6014A as data. Sources: dspic30f6014a.md (sections cited), sfr.csv, abi-elf.md §2.7, isa.md §14.

Registers are in `dspic30f6014a.csv` beside this file. Program addresses are in PC units (2 per 24-bit word).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
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
    InterruptSource,
    Region,
    Sfr,
    SpiSite,
    TimerSite,
    UartSite,
    Vector,
    load_sfrs,
)

SFRS: Final[Mapping[str, Sfr]] = load_sfrs(Path(__file__).with_suffix(".csv"))
"""Every register by its data-sheet name, in address order."""

# §1.1, data space in bytes
SFR_SPACE: Final = Region("sfr", 0x0000, 0x0800)
RAM: Final = Region("ram", 0x0800, 0x2800)
X_RAM: Final = Region("xram", 0x0800, 0x1800)
Y_RAM: Final = Region("yram", 0x1800, 0x2800)
NEAR: Final = Region("near", 0x0000, 0x2000)
PSV_WINDOW: Final = Region("psv", 0x8000, 0x10000)

# §1.2, program space in PC units
FLASH: Final = Region("flash", 0x000000, 0x018000)
RESET_VECTOR: Final = Region("reset", 0x000000, 0x000004)
IVT: Final = Region("ivt", 0x000004, 0x000080)
AIVT: Final = Region("aivt", 0x000084, 0x000100)
USER_FLASH: Final = Region("program", 0x000100, 0x018000)
EEPROM: Final = Region("eedata", 0x7FF000, 0x800000)
UNIT_ID: Final = Region("unitid", 0x8005C0, 0x800600)
CONFIG_SPACE: Final = Region("config", 0xF80000, 0xF80010)
DEVICE_ID_SPACE: Final = Region("devid", 0xFF0000, 0xFF0004)

DEVICE_ID: Final = 0x02C3
REVISION: Final = 0x1002  # UNVERIFIED: process and revision nibbles differ per silicon (§1.2)

_TRAPS: Final = ("ReservedTrap0", "OscillatorFail", "AddressError", "StackError", "MathError")
_TRAP_LEVELS: Final = (0, 14, 13, 12, 11, 0, 0, 0)
_NATURAL_ORDER: Final = (
    "INT0 IC1 OC1 T1 IC2 OC2 T2 T3 SPI1 U1RX U1TX ADC NVM SI2C MI2C CN "
    "INT1 IC7 IC8 OC3 OC4 T4 T5 INT2 U2RX U2TX SPI2 C1 IC3 IC4 IC5 IC6 "
    "OC5 OC6 OC7 OC8 INT3 INT4 C2 PWM QEI DCI LVD FLTA FLTB"
)
"""Interrupt sources by number, as the vendor's linker script spells them (abi-elf.md §2.7)."""
_SOURCES: Final = _NATURAL_ORDER.split()
_ABSENT: Final = {"PWM", "QEI", "FLTA", "FLTB"}
_SLOTS: Final = 62
_FLAG_NAMES: Final = {"ADC": "AD"}
"""Bit names are source + IF, IE, IP, but ADIF for ADC (§5.2)."""


def _vectors() -> tuple[Vector, ...]:
    names = [*_TRAPS, "ReservedTrap5", "ReservedTrap6", "ReservedTrap7"]
    names += [source + "Interrupt" for source in _SOURCES]
    names += [f"Interrupt{irq}" for irq in range(len(_SOURCES), _SLOTS - 8)]
    return tuple(
        Vector(
            slot=slot,
            name=name,
            ivt=IVT.start + 2 * slot,
            aivt=AIVT.start + 2 * slot,
            level=_TRAP_LEVELS[slot] if slot < 8 else 0,
            implemented=_TRAP_LEVELS[slot] > 0 if slot < 8 else slot - 8 in INTERRUPTS,
        )
        for slot, name in enumerate(names)
    )


def _interrupts() -> Mapping[int, InterruptSource]:
    table = {}
    for irq, source in enumerate(_SOURCES):
        if source in _ABSENT:
            continue
        flag, group = f"IFS{irq // 16}", f"IPC{irq // 4}"
        enable = f"IEC{irq // 16}"
        stem = _FLAG_NAMES.get(source, source)
        flag_bit, _ = SFRS[flag].fields[stem + "IF"]
        enable_bit, _ = SFRS[enable].fields[stem + "IE"]
        lsb, _ = SFRS[group].fields[stem + "IP"]
        table[irq] = InterruptSource(irq, source, (flag, flag_bit), (enable, enable_bit), (group, lsb))
    return MappingProxyType(table)


INTERRUPTS: Final = _interrupts()
"""Implemented interrupt sources by number (§5.2)."""

VECTORS: Final = _vectors()
"""All 62 slots in order (§5.1, §5.2)."""


def _config(name: str, address: int, mask: int, **fields: tuple[int, int]) -> ConfigWord:
    return ConfigWord(name, address, mask, MappingProxyType(fields))


CONFIG: Final[Mapping[str, ConfigWord]] = MappingProxyType(
    {
        word.name: word
        for word in (  # §2; masks are the bits a real chip reads back as written
            _config("FOSC", 0xF80000, 0xC71F, FCKSM=(14, 2), FOS=(8, 3), FPR=(0, 5)),
            _config("FWDT", 0xF80002, 0x803F, FWDTEN=(15, 1), FWPSA=(4, 2), FWPSB=(0, 4)),
            _config("FBORPOR", 0xF80004, 0x87B3, MCLREN=(15, 1), BOREN=(7, 1), BORV=(4, 2), FPWRT=(0, 2)),
            _config("FBS", 0xF80006, 0x310F, RBS=(12, 2), EBS=(8, 1), BSS=(1, 3), BWRP=(0, 1)),
            _config("FSS", 0xF80008, 0x330F, RSS=(12, 2), ESS=(8, 2), SSS=(1, 3), SWRP=(0, 1)),
            _config("FGS", 0xF8000A, 0x0007, GSS=(1, 2), GWRP=(0, 1)),
            _config("FICD", 0xF8000C, 0xC003, BKBUG=(15, 1), COE=(14, 1), ICS=(0, 2)),
        )
    }
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
    data=MappingProxyType({r.name: r for r in (SFR_SPACE, RAM, X_RAM, Y_RAM, NEAR, PSV_WINDOW)}),
    program=MappingProxyType(
        {
            r.name: r
            for r in (
                FLASH,
                RESET_VECTOR,
                IVT,
                AIVT,
                USER_FLASH,
                EEPROM,
                UNIT_ID,
                CONFIG_SPACE,
                DEVICE_ID_SPACE,
            )
        }
    ),
    device_id=DEVICE_ID,
    revision=REVISION,
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
    nvm_irq=12,  # §16
    lvd_irq=42,  # §17
)
