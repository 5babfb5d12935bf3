"""Relocation formulas (abi-elf.md §5), on this assembler's objects and on fields in the form of Microchip's
assembler."""

import pytest

from emu.image.elf_facts import RELOCATION_BY_NAME, RELOCATIONS, UNSUPPORTED_RELOCATIONS
from toolchain.elf.model import Bind, Home, ObjectFile, Reloc, Section, Symbol
from toolchain.errors import ToolError
from toolchain.link.link import link
from toolchain.link.options import LinkOptions

CODE, DATA, NEAR_DATA, PSV = 6, 3, 0x01000003, 0x10000002


def linked(reloc: str, word: int, target: Symbol, *sections: Section) -> list[int]:
    """Link a section of two words at 0x104 with a relocation on its first word; return both words."""
    section = Section(".text", CODE, data=bytearray(word.to_bytes(4, "little") + bytes(4)))
    section.relocs.append(Reloc(0, RELOCATION_BY_NAME[reloc].number, target))
    reset = Symbol("__reset", Home.SECTION, section, 0, 0, Bind.GLOBAL)
    obj = ObjectFile("foreign.o", [section, *sections], [reset, target])
    out = link([obj], [], LinkOptions(handles="HANDLE" in reloc))
    start = next(s for s in out.image.symbols if s.name == "__reset")
    at = 2 * (start.value - start.section.address)
    return [int.from_bytes(start.section.data[i : i + 4], "little") for i in (at, at + 4)]


def absolute(value: int) -> Symbol:
    return Symbol("abs", Home.ABSOLUTE, value=value)


def far_code(offset: int = 0) -> Symbol:
    """Return a code symbol at 0x12340 + offset."""
    section = Section("far", CODE | 0x40000000, data=bytearray(64), load=0x12340)
    return Symbol("far", Home.SECTION, section, offset)


@pytest.mark.parametrize(
    ("reloc", "word", "value", "expected"),
    [
        ("FILE_REG_BYTE", 0xB44003, 0x1FF0, 0xB45FF3), ("FILE_REG", 0xEC2000, 0x1FFE, 0xEC3FFE),
        ("FILE_REG_WORD", 0xF80000, 0x8000, 0xF88000), ("FILE_REG_WORD_WITH_DST", 0x800013, 0x1000, 0x808013),
        ("FILE_REG_WORD_WITH_DST", 0x87FFF3, 0x1000, 0x807FF3), ("WORD", 0x2FFFC5, 0x1000, 0x20FFC5),
        ("WORD", 0x200005, 0xFFFF, 0x2FFFF5), ("8", 0x1200FF, 0x10, 0x12000F), ("16", 0x34FFFE, 0x1002, 0x341000),
        ("PWORD", 0xFFFFFF, 0x1001, 0x001000), ("PBYTE", 0x345601, 0x20, 0x345621),
        ("UNSIGNED_4", 0xDD0040, 9, 0xDD0049), ("UNSIGNED_5", 0x400060, 31, 0x40007F),
        ("BIT_SELECT_4", 0xA00000, 12, 0xA0C000),
        ("BIT_SELECT_4_BYTE", 0xA00400, 5, 0xA05400), ("BIT_SELECT_3", 0xA80000, 5, 0xA8A000),
        ("DSP_6", 0xC80040, -16, 0xC80070),
        ("DSP_PRESHIFT", 0xCA0000, -8, 0xCA0400), ("SIGNED_10_BYTE", 0xB04000, -1, 0xB04FF0),
        ("UNSIGNED_10", 0xB00000, 1023, 0xB03FF0),
        ("UNSIGNED_14", 0x090000, 0x3FFF, 0x093FFF), ("FRAME_SIZE", 0xFA0000, 0x3FFE, 0xFA3FFE),
        ("PWRSAV_MODE", 0xFE4000, 1, 0xFE4001),
        ("PCREL_BRANCH", 0x370000, 0x104, 0x37FFFF), ("PCREL_BRANCH", 0x370010, 0x104, 0x370007),
        ("BRANCH_ABSOLUTE", 0x37FFFC, 0x104, 0x37FFFD),
        ("PCREL_DO", 0x000000, 0x10A, 0x000002), ("TBLOFFSET", 0, 0x12345, 0x2345),
        ("WORD_TBLOFFSET", 0x200001, 0x12345, 0x223451),
        ("WORD_TBLPAGE", 0x200001, 0x12345, 0x200011), ("WORD_PSVPAGE", 0x200001, 0x12345, 0x200021),
        ("WORD_PSVOFFSET", 0x200001, 0x12345, 0x2A3451), ("P_PADDR", 0, 0x12345, 0x012345),
        ("P_TBLPAGE", 0, 0x12345, 1),
        ("WORD_ADDR_HI", 0x200000, 0x12345, 0x200010), ("ADDR_LO", 0, 0x12345, 0x2345),
    ],
)  # fmt: skip
def test_each_type_computes_its_value_and_keeps_the_other_bits(reloc, word, value, expected):
    """Each relocation type computes its value and keeps all other bits (abi-elf.md §5, table).

    The addend is in the field, signed for branches and words.
    """
    assert linked(reloc, word, absolute(value))[0] == expected


def test_code_targets_above_64k():
    """Code targets above 64 K are resolved (abi-elf.md §5, verified there with a target above 0x10000)."""
    symbol = far_code(2)
    assert linked("WORD_TBLPAGE", 0x200000, symbol, symbol.section)[0] == 0x200010
    symbol = far_code(2)
    assert linked("P_PADDR", 0, symbol, symbol.section)[0] == 0x012342


def test_calls_take_both_words_and_carry_an_addend():
    """Relocations 32/33 of CALL fill both words and carry an addend; Microchip's linker loses the carry of `call
    sym+8`.

    Source: abi-elf.md §5.
    """
    section = Section(".text", CODE, data=bytearray.fromhex("0800020000000000"))
    target = absolute(0xFFFC)
    section.relocs += [Reloc(0, 32, target), Reloc(4, 33, target)]
    reset = Symbol("__reset", Home.SECTION, section, 0, 0, Bind.GLOBAL)
    out = link([ObjectFile("x.o", [section], [reset])], [], LinkOptions())
    text = next(s for s in out.image.sections if s.name == ".text")
    assert bytes(text.data[-8:]) == bytes.fromhex("0400020001000000")


def test_relocations_against_a_section_symbol_use_the_field_as_offset():
    """A relocation against a section symbol uses the field as offset (abi-elf.md §5)."""
    data = Section(".ndata", NEAR_DATA, data=bytearray(20))
    symbol = Symbol(".ndata", Home.SECTION, data, 0, type=3)
    assert linked("WORD", 0x200060, symbol, data)[0] == 0x208060


def test_psv_symbols_are_worth_their_window_address():
    """A plain `mov #sym` of a PSV symbol gives its VMA in the window (abi-elf.md §4.2)."""
    psv = Section("const2", PSV, data=bytearray(8), load=0)
    symbol = Symbol("c", Home.SECTION, psv, 2)
    assert linked("WORD", 0x200000, symbol, psv)[0] >> 4 & 0xFFFF == 0x8000 | 0x106


def test_undefined_weak_symbols_are_zero():
    """Undefined weak symbols have the value 0 (abi-elf.md §5)."""
    weak = Symbol("missing", Home.UNDEFINED, bind=Bind.WEAK)
    assert linked("WORD", 0x2FFFF0, weak)[0] == 0x2FFFF0
    assert linked("WORD_HANDLE", 0x200000, weak)[0] == 0x200000


@pytest.mark.parametrize(
    ("reloc", "word", "value", "message"),
    [
        ("FILE_REG_BYTE", 0, 0x2000, "near addressing: the address must be below 0x2000"),
        ("FILE_REG", 0, 0x801, "must be even"),
        ("FILE_REG_WORD", 0, 0x801, "must be even"), ("FILE_REG_WORD_WITH_DST", 0, 0x801, "odd address"),
        ("WORD", 0, 0x10000, "outside"), ("8", 0, 256, "outside -128..255"), ("PCREL_BRANCH", 0, 0x17000, "away"),
        ("PCREL_BRANCH", 0, 0x105, "odd"), ("PCREL_DO", 0, 0x102, "shorter than two"),
        ("UNSIGNED_5", 0, 32, "outside 0..31"),
        ("FRAME_SIZE", 0, 3, "even"), ("DSP_6", 0, 17, "outside -16..16"), ("UNSIGNED_10", 0, 1024, "outside"),
    ],
)  # fmt: skip
def test_values_that_do_not_fit_are_errors_with_object_place_and_symbol(reloc, word, value, message):
    """A value that does not fit is an error with object, offset and symbol, never truncated (abi-elf.md §1.4, §5)."""
    with pytest.raises(ToolError) as error:
        linked(reloc, word, absolute(value))
    assert message in str(error.value)
    assert str(error.value).startswith("foreign.o:(.text+0x0): error: abs: ")


def test_a_near_access_to_far_data_is_explained():
    """A near access to far data is explained: "Value must be less than 8192" (abi-elf.md §1.4)."""
    far = Section("farbss", DATA | 0x40000000, 8, nobits_units=4, load=0x2100)
    symbol = Symbol("_g", Home.SECTION, far, 2)
    with pytest.raises(ToolError, match="_g: cannot access it at 0x2102 with near addressing"):
        linked("FILE_REG", 0xEC2000, symbol, far)


def test_code_addresses_do_not_fit_data_words():
    """A code address in a data word is refused: cannot reference executable symbol (abi-elf.md §4.2)."""
    for reloc in ("WORD", "16"):
        symbol = far_code()
        with pytest.raises(ToolError, match="executable symbol"):
            linked(reloc, 0, symbol, symbol.section)


def test_operators_on_data_are_refused():
    """Address operators applied to data are refused (abi-elf.md §4.2, allowed targets)."""
    data = Section(".ndata", NEAR_DATA, data=bytearray(8))
    symbol = Symbol("_d", Home.SECTION, data, 0)
    with pytest.raises(ToolError, match="needs a program address"):
        linked("WORD_TBLOFFSET", 0, symbol, data)


def test_every_number_is_either_described_or_refused_with_a_reason():
    """Each relocation number 0..94 of abi-elf.md §5 is either implemented or refused with a reason."""
    assert set(RELOCATIONS) | set(UNSUPPORTED_RELOCATIONS) == set(range(95))
    assert not set(RELOCATIONS) & set(UNSUPPORTED_RELOCATIONS)


@pytest.mark.parametrize(("number", "message"), [(46, "DMA parts only"), (93, "ambiguous"), (200, "does not exist")])
def test_unknown_relocations_are_refused(number, message):
    """Unknown relocation numbers, of other cores or damaged objects, are refused."""
    section = Section(".text", CODE, data=bytearray(8))
    section.relocs.append(Reloc(0, number, absolute(0)))
    reset = Symbol("__reset", Home.SECTION, section, 0, 0, Bind.GLOBAL)
    with pytest.raises(ToolError, match=message):
        link([ObjectFile("x.o", [section], [reset])], [], LinkOptions())


def test_a_field_outside_its_section_is_refused():
    """A relocation outside its section is refused: a damaged object cannot write elsewhere."""
    section = Section(".text", CODE, data=bytearray(4))
    section.relocs.append(Reloc(400, 8, absolute(0)))
    reset = Symbol("__reset", Home.SECTION, section, 0, 0, Bind.GLOBAL)
    with pytest.raises(ToolError, match="outside its section"):
        link([ObjectFile("x.o", [section], [reset])], [], LinkOptions())
