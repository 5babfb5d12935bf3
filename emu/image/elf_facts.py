"""ELF constants of the dsPIC30F: machine number, flag bits, relocation table, octet rule.

Pure data for the emulator's loader and for `toolchain.elf`, `toolchain.asm` and `toolchain.link`. Units: an *address
unit* is a PC step of 1 in code (an instruction is 2) and a byte in data; an *octet* is a byte of the file. All facts
come from abi-elf.md §5 and §6, cited at each line.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntFlag

EM_DSPIC30F = 118  # abi-elf.md §6.1
PROCESSOR_MASK = 0xFFFF  # e_flags low 16 bits = processor id, §6.1
GENERIC_PROCESSORS = (0, 90, 91)  # 30Fxxxx, any 16-bit, any DSP part (§6.1)

OCTETS_PER_UNIT = 2  # §6.2: this holds for *every* section
OCTETS_PER_WORD = 4  # one program word: low, middle, upper, phantom 0
UNITS_PER_WORD = 2

PSV_WINDOW = 0x8000  # §6.4: VMA of a psv object = 0x8000 | (LMA & 0x7FFF)
PSV_PAGE_UNITS = 0x8000
EXT_ATTR_PREFIX = "__ext_attr_"  # §6.3: local absolute symbol carrying attributes that do not fit sh_flags


class SectionFlag(IntFlag):
    """sh_flags bits (abi-elf.md §6.3)."""

    WRITE = 1 << 0
    ALLOC = 1 << 1
    EXECINSTR = 1 << 2
    MERGE = 1 << 4
    STRINGS = 1 << 5
    MEMORY = 1 << 18
    SECURE = 1 << 20
    BOOT = 1 << 21
    DMA = 1 << 22
    NOLOAD = 1 << 23
    NEAR = 1 << 24
    PERSIST = 1 << 25
    XMEM = 1 << 26
    YMEM = 1 << 27
    PSV = 1 << 28
    EEDATA = 1 << 29
    ABSOLUTE = 1 << 30
    REVERSE = 1 << 31


class ExtendedAttribute(IntFlag):
    """Value bits of an `__ext_attr_<section>` symbol (abi-elf.md §6.3)."""

    HEAP = 1
    STACK = 2
    EDS = 4
    PAGE = 8
    AUXFLASH = 0x10
    PACKEDFLASH = 0x20


class Content(Enum):
    """Encoding of a section's bytes or words in octets (abi-elf.md §6.2)."""

    WORDS = "words"  # lo, mid, hi, 0: one program word, 2 units
    BYTES = "bytes"  # b0, 0, b1, 0: two bytes, 2 units
    PAIRS = "pairs"  # b0, b1, upper, 0: psv and eedata in executables


def content_kind(flags: int, executable: bool) -> Content:
    """Return the octet layout of a section with sh_flags `flags` (abi-elf.md §6.2)."""
    if flags & SectionFlag.EXECINSTR:
        return Content.WORDS
    if executable and flags & (SectionFlag.PSV | SectionFlag.EEDATA):
        return Content.PAIRS
    return Content.BYTES


class Formula(Enum):
    """Formula for a relocation's value from S (symbol address), L (load address), A (addend), P (place); §5."""

    NONE = "none"
    ADDRESS = "S+A"
    HALF = "(S>>1)+field"
    HANDLE = "handle(L+A)"
    LOAD = "L+A"
    PSVOFFSET = "((L+A)&0xFFFF)|0x8000"
    TBLOFFSET = "(L+A)&0xFFFF"
    PSVPAGE = "(L+A)>>15"
    TBLPAGE = "(L+A)>>16"
    BRANCH = "(S+A-(P+2))>>1"
    DO_END = "(S+A-(P+2))>>1, not -2..0"
    LOW16 = "(S+A)&0xFFFF"
    HIGH7 = "S>>16"
    EDSPAGE = "edspage"
    EDSOFFSET = "edsoffset"
    ADDR_LOW = "addr_lo"
    ADDR_HIGH = "addr_hi"
    OTHER_CORE = "unsupported"


class RelocatedField(Enum):
    """Kind of the data that contains the relocated field."""

    WORD = "bits of one program word"
    DATA = "little-endian data bytes that skip phantom (and, in code, upper) octets"
    PDATA = "bytes of program words, all three used"


@dataclass(frozen=True, slots=True)
class RelocationType:
    """One row of the relocation table (abi-elf.md §5).

    `lsb` and `width` are in bits. For `RelocatedField.WORD` they select bits of the 24-bit word; otherwise `width` is
    the number of data bits. Values in `low`..`high` are accepted; `even` requires bit 0 to be 0.
    """

    number: int
    name: str
    place: RelocatedField
    lsb: int
    width: int
    formula: Formula
    low: int
    high: int
    even: bool = False


_W, _D, _P = RelocatedField.WORD, RelocatedField.DATA, RelocatedField.PDATA
_F = Formula
_WORD_RANGE = (-0x8000, 0xFFFF)  # abi-elf.md §4.1: a word literal may be signed or unsigned
_ANY32 = (-0x80000000, 0xFFFFFFFF)
_ANY24 = (-0x800000, 0xFFFFFF)
_BRANCH_RANGE = (-0x8000, 0x7FFF)  # isa.md §3.2 Slit16, instruction words
_NEAR_RANGE = (0, 0x1FFF)  # isa.md §3.3: 13-bit file register address

_ROWS: tuple[tuple[int, str, RelocatedField, int, int, Formula, tuple[int, int], bool], ...] = (
    (0, "NONE", _D, 0, 0, _F.NONE, (0, 0), False),
    (1, "8", _D, 0, 8, _F.ADDRESS, (-128, 255), False),
    (2, "16", _D, 0, 16, _F.ADDRESS, _WORD_RANGE, False),
    (3, "32", _D, 0, 32, _F.ADDRESS, _ANY32, False),
    (4, "FILE_REG_BYTE", _W, 0, 13, _F.ADDRESS, _NEAR_RANGE, False),
    (5, "FILE_REG", _W, 0, 13, _F.ADDRESS, _NEAR_RANGE, True),
    (6, "FILE_REG_WORD", _W, 0, 16, _F.ADDRESS, (0, 0xFFFF), True),
    (7, "FILE_REG_WORD_WITH_DST", _W, 4, 15, _F.HALF, (0, 0xFFFF), True),
    (8, "WORD", _W, 4, 16, _F.ADDRESS, _WORD_RANGE, False),
    (9, "PBYTE", _P, 0, 8, _F.ADDRESS, (-128, 255), False),
    (10, "PWORD", _P, 0, 24, _F.ADDRESS, _ANY24, False),
    (11, "HANDLE", _D, 0, 16, _F.HANDLE, (0, 0xFFFF), False),
    (12, "PADDR", _D, 0, 32, _F.LOAD, (0, 0xFFFFFF), False),
    (13, "P_PADDR", _P, 0, 24, _F.LOAD, (0, 0xFFFFFF), False),
    (14, "PSVOFFSET", _D, 0, 16, _F.PSVOFFSET, (0, 0xFFFF), False),
    (15, "TBLOFFSET", _D, 0, 16, _F.TBLOFFSET, (0, 0xFFFF), False),
    (16, "WORD_HANDLE", _W, 4, 16, _F.HANDLE, (0, 0xFFFF), False),
    (17, "WORD_PSVOFFSET", _W, 4, 16, _F.PSVOFFSET, (0, 0xFFFF), False),
    (18, "PSVPAGE", _D, 0, 16, _F.PSVPAGE, (0, 0xFFFF), False),
    (19, "P_PSVPAGE", _P, 0, 24, _F.PSVPAGE, (0, 0xFFFF), False),
    (20, "WORD_PSVPAGE", _W, 4, 16, _F.PSVPAGE, (0, 0xFFFF), False),
    (21, "WORD_TBLOFFSET", _W, 4, 16, _F.TBLOFFSET, (0, 0xFFFF), False),
    (22, "TBLPAGE", _D, 0, 16, _F.TBLPAGE, (0, 0xFFFF), False),
    (23, "P_TBLPAGE", _P, 0, 24, _F.TBLPAGE, (0, 0xFFFF), False),
    (24, "WORD_TBLPAGE", _W, 4, 16, _F.TBLPAGE, (0, 0xFFFF), False),
    (25, "P_HANDLE", _P, 0, 24, _F.HANDLE, (0, 0xFFFF), False),
    (26, "P_PSVOFFSET", _P, 0, 24, _F.PSVOFFSET, (0, 0xFFFF), False),
    (27, "P_TBLOFFSET", _P, 0, 24, _F.TBLOFFSET, (0, 0xFFFF), False),
    (28, "PCREL_BRANCH", _W, 0, 16, _F.BRANCH, _BRANCH_RANGE, True),
    (29, "BRANCH_ABSOLUTE", _W, 0, 16, _F.BRANCH, _BRANCH_RANGE, True),
    (30, "PCREL_DO", _W, 0, 16, _F.DO_END, _BRANCH_RANGE, True),
    (31, "DO_ABSOLUTE", _W, 0, 16, _F.DO_END, _BRANCH_RANGE, True),
    (32, "PGM_ADDR_LSB", _W, 0, 16, _F.LOW16, (0, 0xFFFF), True),
    (33, "PGM_ADDR_MSB", _W, 0, 16, _F.HIGH7, (0, 0x7F), False),
    (34, "UNSIGNED_4", _W, 0, 4, _F.ADDRESS, (0, 15), False),
    (35, "UNSIGNED_5", _W, 0, 5, _F.ADDRESS, (0, 31), False),
    (36, "BIT_SELECT_3", _W, 13, 3, _F.ADDRESS, (0, 7), False),
    (37, "BIT_SELECT_4_BYTE", _W, 12, 3, _F.ADDRESS, (0, 7), False),
    (38, "BIT_SELECT_4", _W, 12, 4, _F.ADDRESS, (0, 15), False),
    (39, "DSP_6", _W, 0, 6, _F.ADDRESS, (-16, 16), False),
    (40, "DSP_PRESHIFT", _W, 7, 4, _F.ADDRESS, (-8, 7), False),
    (41, "SIGNED_10_BYTE", _W, 4, 8, _F.ADDRESS, (-128, 255), False),
    (42, "UNSIGNED_10", _W, 4, 10, _F.ADDRESS, (0, 1023), False),
    (43, "UNSIGNED_14", _W, 0, 14, _F.ADDRESS, (0, 0x3FFF), False),
    (44, "FRAME_SIZE", _W, 0, 14, _F.ADDRESS, (0, 0x3FFE), True),
    (45, "PWRSAV_MODE", _W, 0, 1, _F.ADDRESS, (0, 1), False),
    (59, "EDSPAGE", _D, 0, 16, _F.EDSPAGE, (0, 0xFFFF), False),
    (60, "P_EDSPAGE", _P, 0, 24, _F.EDSPAGE, (0, 0xFFFF), False),
    (61, "WORD_EDSPAGE", _W, 4, 16, _F.EDSPAGE, (0, 0xFFFF), False),
    (62, "EDSOFFSET", _D, 0, 16, _F.EDSOFFSET, (0, 0xFFFF), False),
    (63, "P_EDSOFFSET", _P, 0, 24, _F.EDSOFFSET, (0, 0xFFFF), False),
    (64, "WORD_EDSOFFSET", _W, 4, 16, _F.EDSOFFSET, (0, 0xFFFF), False),
    # 72-80: lit10 of an instruction is in bits 13-4 (isa.md §5). abi-elf.md §5 says 9-0, from a table that was never
    # tested. UNVERIFIED against Microchip's linker.
    (72, "UNSIGNED_10_TBLOFFSET", _W, 4, 10, _F.TBLOFFSET, (0, 1023), False),
    (73, "UNSIGNED_10_PSVOFFSET", _W, 4, 10, _F.PSVOFFSET, (0, 1023), False),
    (74, "UNSIGNED_10_TBLPAGE", _W, 4, 10, _F.TBLPAGE, (0, 1023), False),
    (75, "UNSIGNED_10_PSVPAGE", _W, 4, 10, _F.PSVPAGE, (0, 1023), False),
    (76, "UNSIGNED_10_HANDLE", _W, 4, 10, _F.HANDLE, (0, 1023), False),
    (79, "UNSIGNED_10_EDSPAGE", _W, 4, 10, _F.EDSPAGE, (0, 1023), False),
    (80, "UNSIGNED_10_EDSOFFSET", _W, 4, 10, _F.EDSOFFSET, (0, 1023), False),
    (89, "ADDR_LO", _D, 0, 16, _F.ADDR_LOW, (0, 0xFFFF), False),
    (90, "ADDR_HI", _D, 0, 16, _F.ADDR_HIGH, (0, 0xFFFF), False),
    (91, "P_ADDR_LO", _P, 0, 24, _F.ADDR_LOW, (0, 0xFFFF), False),
    (94, "WORD_ADDR_HI", _W, 4, 16, _F.ADDR_HIGH, (0, 0xFFFF), False),
)

# Numbers that are defined for other cores, obsolete PSVPTR groups or CodeGuard. Microchip's own table swaps 92
# and 93, so that no interpretation of them is safe (abi-elf.md §5).
UNSUPPORTED_RELOCATIONS: dict[int, str] = {
    **dict.fromkeys((46, 47, 48, 69, 70, 71, 77, 78), "DMA parts only"),
    **dict.fromkeys((49, 50, 51, 52, 81), "obsolete PSVPTR"),
    **dict.fromkeys((53, 54, 55, 56, 57, 58, 82), "CodeGuard access slot"),
    **dict.fromkeys((65, 66, 67, 68, 83, 84, 85, 86, 87, 88), "other cores only"),
    **dict.fromkeys((92, 93), "its meaning is ambiguous in Microchip's own tools"),
}

RELOCATIONS: dict[int, RelocationType] = {
    number: RelocationType(number, f"R_PIC30_{name}", place, lsb, width, formula, limits[0], limits[1], even)
    for number, name, place, lsb, width, formula, limits, even in _ROWS
}
RELOCATION_BY_NAME: dict[str, RelocationType] = {r.name.removeprefix("R_PIC30_"): r for r in RELOCATIONS.values()}
