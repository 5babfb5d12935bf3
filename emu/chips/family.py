"""Data common to all dsPIC30F chips: vectors, interrupt bit locations, maps of both address spaces.

Each chip's own folder says which of the devices it implements. Sources: dspic30f6014a.md §1, §2, §5, abi-elf.md §2.7,
isa.md §14. Program addresses are in PC units (2 per 24-bit word).
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from emu.chips.chip import ClockModes, ConfigWord, InterruptSource, Region, Sfr, Vector

IVT: Final = Region("ivt", 0x000004, 0x000080)
AIVT: Final = Region("aivt", 0x000084, 0x000100)
UNIT_ID: Final = Region("unitid", 0x8005C0, 0x800600)
CONFIG_SPACE: Final = Region("config", 0xF80000, 0xF80010)
_SFR_END: Final = 0x0800
_EEPROM_END: Final = 0x800000

_TRAPS: Final = ("ReservedTrap0", "OscillatorFail", "AddressError", "StackError", "MathError",
                 "ReservedTrap5", "ReservedTrap6", "ReservedTrap7")  # fmt: skip
_TRAP_LEVELS: Final = (0, 14, 13, 12, 11, 0, 0, 0)
_NATURAL_ORDER: Final = (
    "INT0 IC1 OC1 T1 IC2 OC2 T2 T3 SPI1 U1RX U1TX ADC NVM SI2C MI2C CN "
    "INT1 IC7 IC8 OC3 OC4 T4 T5 INT2 U2RX U2TX SPI2 C1 IC3 IC4 IC5 IC6 "
    "OC5 OC6 OC7 OC8 INT3 INT4 C2 PWM QEI DCI LVD FLTA FLTB"
)
"""Interrupt sources by number, spelled as in the vendor's linker script (abi-elf.md §2.7)."""
_SOURCES: Final = _NATURAL_ORDER.split()
_SLOTS: Final = 62
_FLAG_NAMES: Final = {"ADC": "AD"}
"""Exceptions to the rule that an interrupt's bits are called source + IF, IE, IP: ADC has ADIF etc. (§5.2)."""


def interrupts_of(sfrs: Mapping[str, Sfr]) -> Mapping[int, InterruptSource]:
    """Return a chip's interrupt sources by number: those whose flag bit exists in its registers."""
    table = {}
    for irq, source in enumerate(_SOURCES):
        flag, enable, group = f"IFS{irq // 16}", f"IEC{irq // 16}", f"IPC{irq // 4}"
        stem = _FLAG_NAMES.get(source, source)
        if stem + "IF" not in sfrs[flag].fields:
            continue
        flag_bit, _ = sfrs[flag].fields[stem + "IF"]
        enable_bit, _ = sfrs[enable].fields[stem + "IE"]
        lsb, _ = sfrs[group].fields[stem + "IP"]
        table[irq] = InterruptSource(irq, source, (flag, flag_bit), (enable, enable_bit), (group, lsb))
    return MappingProxyType(table)


def vectors_of(interrupts: Mapping[int, InterruptSource]) -> tuple[Vector, ...]:
    """Return all 62 vectors in order (§5.1, §5.2)."""
    names = [*_TRAPS, *(source + "Interrupt" for source in _SOURCES)]
    names += [f"Interrupt{irq}" for irq in range(len(_SOURCES), _SLOTS - len(_TRAPS))]
    return tuple(
        Vector(
            slot=slot,
            name=name,
            ivt=IVT.start + 2 * slot,
            aivt=AIVT.start + 2 * slot,
            level=_TRAP_LEVELS[slot] if slot < len(_TRAPS) else 0,
            implemented=_TRAP_LEVELS[slot] > 0 if slot < len(_TRAPS) else slot - len(_TRAPS) in interrupts,
        )
        for slot, name in enumerate(names)
    )


def _by_name(*regions: Region) -> Mapping[str, Region]:
    return MappingProxyType({region.name: region for region in regions})


def data_space(y_start: int, ram_end: int) -> Mapping[str, Region]:
    """Return the map of data space in bytes (§1.1). RAM follows the SFRs; Y RAM is the upper part of RAM."""
    return _by_name(
        Region("sfr", 0x0000, _SFR_END),
        Region("ram", _SFR_END, ram_end),
        Region("xram", _SFR_END, y_start),
        Region("yram", y_start, ram_end),
        Region("near", 0x0000, 0x2000),
        Region("psv", 0x8000, 0x10000),
    )


def program_space(flash_end: int, eeprom_bytes: int) -> Mapping[str, Region]:
    """Return the map of program space in PC units (§1.2). A word of EEPROM takes two PC units."""
    return _by_name(
        Region("flash", 0x000000, flash_end),
        Region("reset", 0x000000, IVT.start),
        IVT,
        AIVT,
        Region("program", AIVT.end, flash_end),
        Region("eedata", _EEPROM_END - eeprom_bytes, _EEPROM_END),
        UNIT_ID,
        CONFIG_SPACE,
        Region("devid", 0xFF0000, 0xFF0004),
    )


def config_word(name: str, address: int, mask: int, **fields: tuple[int, int]) -> ConfigWord:
    """Return a configuration word. `mask` selects the bits that read back as written."""
    return ConfigWord(name, address, mask, MappingProxyType(fields))


def config_words(*words: ConfigWord) -> Mapping[str, ConfigWord]:
    """Return configuration words by name."""
    return MappingProxyType({word.name: word for word in words})


_WITH_CRYSTAL: Final = {
    0b0101: ("crystal", 4.0), 0b0110: ("crystal", 8.0), 0b0111: ("crystal", 16.0),
    0b1101: ("crystal", 4.0), 0b1110: ("crystal", 8.0), 0b1111: ("crystal", 16.0),
}  # fmt: skip
"""PLL modes of a crystal (XT) and of an external clock (EC), by FPR."""
_WITH_FRC: Final = {0b0001: ("frc", 4.0), 0b0011: ("frc", 16.0), 0b1010: ("frc", 8.0)}

_WITHOUT_PLL: Final = frozenset((0b0000, 0b0010, 0b0100, 0b1000, 0b1001, 0b1011, 0b1100))
"""FPR of XTL, HS, XT, ERCIO, ERC, EC and ECIO (dspic30f6014a.md §2)."""

CLOCK_BY_FPR: Final = ClockModes(3, 3, MappingProxyType(_WITH_CRYSTAL | _WITH_FRC), ("crystal", 1.0), _WITHOUT_PLL)
"""FOS in two bits, FPR in four: 30F4011 and 30F4012. The vendor's header p30f4011.h has the codes of the modes."""
CLOCK_BY_FPR_WITHOUT_FRC_PLL: Final = ClockModes(3, 3, MappingProxyType(_WITH_CRYSTAL), ("crystal", 1.0), _WITHOUT_PLL)
"""As `CLOCK_BY_FPR` without PLL modes of the FRC: 30F6010 to 30F6014. UNVERIFIED: DS70117 was not available."""
CLOCK_BY_FOS: Final = ClockModes(7, 3, MappingProxyType(_WITH_CRYSTAL | _WITH_FRC | {
    0b10001: ("crystal", 2.0), 0b10010: ("crystal", 4.0), 0b10011: ("crystal", 8.0),
    0b10101: ("crystal", 4 / 3), 0b10110: ("crystal", 8 / 3), 0b10111: ("crystal", 16 / 3),
}), ("crystal", 8.0), _WITHOUT_PLL)  # fmt: skip
"""FOS in three bits, FPR in five: 30F3014, 30F4013 and the A parts (dspic30f6014a.md §2). Reserved FPR codes and images
without configuration words have the setting of the e-puck's library."""
FOSC_OF_FPR: Final = config_word("FOSC", 0xF80000, 0xC30F, FCKSM=(14, 2), FOS=(8, 2), FPR=(0, 4))
FGS_WITHOUT_SEGMENTS: Final = config_word("FGS", 0xF8000A, 0x0003, GCP=(1, 1), GWRP=(0, 1))
"""FGS of parts without CodeGuard."""
FOSC_OF_FOS: Final = config_word("FOSC", 0xF80000, 0xC71F, FCKSM=(14, 2), FOS=(8, 3), FPR=(0, 5))

SLOTS: Final = vectors_of({})
"""Names and addresses of all vectors, equal for every chip; which of them are implemented differs."""
