"""ELF executables as images: words, addresses, names, and refused files."""

from __future__ import annotations

import struct

import pytest

from emu.image.loader import load_image, parse_image
from emu.image.model import LoadError
from tests.emu.loader.elf_samples import CODE, DATA_COPY, PSV, ElfSample, Name, SampleSection, words, xc16_like


def parsed(sample: ElfSample):
    return parse_image(sample.build(), "sample.elf")


def refusal(data: bytes) -> str:
    with pytest.raises(LoadError) as caught:
        parse_image(data, "sample.elf")
    return str(caught.value)


def test_code_words_drop_the_phantom_octet_and_sit_at_their_pc_address():
    """abi-elf.md §6.8 step 3: code words are stored at their PC address, without the phantom octet."""
    image = parsed(xc16_like())
    assert image.word(0x000000) == 0x040100
    assert image.word(0x000104) == 0xDA4000
    assert image.word(0x000202) == 0x37FFFF
    assert image.word(0x00010A) is None


def test_psv_and_eeprom_words_sit_at_the_load_address_of_their_program_header():
    """abi-elf.md §6.4: psv and EEPROM words are stored at p_paddr, the program address; sh_addr is the window
    address."""
    image = parsed(xc16_like())
    assert image.word(0x010180) == 0x00BBAA
    assert image.word(0x7FF000) == 0x001234
    assert image.word(0x008180) is None


def test_data_sections_marked_noload_define_no_program_words():
    """abi-elf.md §6.3: data sections with the NOLOAD flag define no program words, because their initial values are
    in .dinit."""
    image = parsed(xc16_like())
    assert image.word(0x000800) is None
    assert [section.kind for section in image.sections if section.name == ".ndata"] == ["data"]


def test_flash_is_erased_where_no_section_defines_it():
    """abi-elf.md §6.8 step 6: flash that no section defines is erased."""
    flash = parsed(xc16_like()).flash()
    assert len(flash) == 0xC000
    assert flash[0x102 // 2] == 0x200021
    assert flash[-1] == 0xFFFFFF


def test_config_words_are_found_in_their_region():
    image = parsed(xc16_like())
    assert list(image.words(image.chip.program["config"])) == [(0xF80000, 0x00C706)]


def test_symbols_are_found_by_object_name_and_by_c_name():
    """abi-elf.md §2.6: symbols are found by object name and by C name."""
    symbols = parsed(xc16_like()).symbols
    main = symbols.find("main")
    assert main is symbols.find("_main")
    assert (main.address, main.space, main.kind) == (0x104, "code", "function")
    assert symbols.find("counter").address == 0x800
    assert symbols.find("table").load_address == 0x10180
    assert symbols.find("nothing") is None


def test_an_address_is_named_by_function_or_global_label_never_by_compiler_labels():
    """abi-elf.md §6.5: an address is named by a function or global label, never by a label of the compiler."""
    symbols = parsed(xc16_like()).symbols
    assert symbols.text(0x106) == "_main+0x2"
    assert symbols.text(0x100) == "__reset"
    assert symbols.text(0x202) == "_helper+0x2"
    assert symbols.text(0x204) == "0x000204"
    assert symbols.text(0x002) == "0x000002"


def test_a_data_address_is_named_only_inside_the_variable():
    symbols = parsed(xc16_like()).symbols
    symbol, distance = symbols.variable_at(0x804)
    assert (symbol.name, distance) == ("_buffer", 2)
    assert symbols.variable_at(0x806) is None


def test_an_unusual_processor_id_is_a_warning():
    """abi-elf.md §6.8 step 1: an unusual processor id is a warning."""
    sample = xc16_like()
    sample.flags = 0x5A
    image = parsed(sample)
    assert "processor id 0x5a, not for the dsPIC30F6014A" in image.warnings[0]
    assert not parsed(xc16_like()).warnings


def test_a_phantom_octet_that_is_not_zero_is_a_warning_and_ignored():
    image = parsed(ElfSample([SampleSection(".text", 0x100, struct.pack("<I", 0x12040506))]))
    assert image.word(0x100) == 0x040506
    assert "0x000100" in image.warnings[0]


def test_ram_data_without_noload_is_a_warning_and_not_loaded():
    """abi-elf.md §6.8 step 2: RAM data without NOLOAD, which only objects contain, are a warning and not loaded."""
    sample = xc16_like()
    sample.parts.append(SampleSection(".data", 0x900, words(1), DATA_COPY & ~0x0080_0000))
    assert any("RAM" in warning for warning in parsed(sample).warnings)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"machine": 105}, "is built for MSP430 (e_machine 105), expected dsPIC30F (118)"),
        ({"machine": 83}, "AVR (e_machine 83), expected dsPIC30F (118); `emu run --board kilobot` runs images"),
        ({"machine": 4711}, "is built for an unknown machine (e_machine 4711)"),
        ({"type": 1}, "is an object file; link it into an executable first"),
        ({"type": 3}, "has ELF type 3, expected 2"),
        ({"ident": b"\x7fELF\x02\x01\x01" + bytes(9)}, "expected 1 (32 bit)"),
    ],
)
def test_a_file_for_something_else_is_refused_by_name(change, expected):
    sample = xc16_like()
    for name, value in change.items():
        setattr(sample, name, value)
    assert expected in refusal(sample.build())


def test_every_truncation_is_refused_and_says_so():
    """Every truncation of a file is refused with a message. The section header table is last, so any missing octet is
    detected."""
    whole = xc16_like().build()
    for length in range(4, len(whole), 97):
        assert "truncated" in refusal(whole[:length])


def test_overlapping_sections_are_refused_with_both_names():
    sample = xc16_like()
    sample.parts.append(SampleSection(".late", 0x104, words(0)))
    text = refusal(sample.build())
    assert "'.text' and section '.late' overlap at 0x000104" in text


@pytest.mark.parametrize("address", [0x17FFE, 0x18000, 0x7FEFFE, 0x900000])
def test_words_outside_program_memory_are_refused(address):
    assert "no program memory" in refusal(ElfSample([SampleSection(".text", address, words(1, 2))]).build())


def test_an_odd_program_address_is_refused():
    assert "odd address 0x101" in refusal(ElfSample([SampleSection(".text", 0x101, words(1))]).build())


def test_a_psv_section_without_program_header_is_refused():
    sample = ElfSample([SampleSection(".text", 0x100, words(1)), SampleSection(".const", 0x8200, words(1), PSV)])
    data = bytearray(sample.build())
    struct.pack_into("<H", data, 44, 1)
    assert "no program header gives its load address" in refusal(bytes(data))


def test_a_stripped_file_is_refused_with_the_reason():
    data = bytearray(xc16_like().build())
    struct.pack_into("<H", data, 48, 0)
    assert "no section headers" in refusal(bytes(data))


def test_a_file_without_code_is_refused():
    assert "holds no program words" in refusal(ElfSample([SampleSection(".bss", 0x800, b"", CODE, 8, size=4)]).build())


def test_symbols_with_broken_names_are_omitted():
    sample = ElfSample([SampleSection(".text", 0x100, words(1))], [Name("_good", 0x100)])
    data = sample.build()
    broken = data.replace(
        struct.pack("<IIIBBH", 1, 0x100, 0, 0x10, 0, 1), struct.pack("<IIIBBH", 9999, 0x100, 0, 0x10, 0, 1)
    )
    assert broken != data
    assert len(parse_image(broken, "x").symbols) == 0


def test_files_are_read_from_disk(tmp_path):
    path = tmp_path / "firmware.elf"
    path.write_bytes(xc16_like().build())
    assert load_image(path).path == str(path)
