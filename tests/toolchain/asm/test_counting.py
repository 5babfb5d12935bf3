"""Location counting and data layout in code and data sections (abi-elf.md §4.3, §4.4)."""

import struct

import pytest

from toolchain.errors import ToolError


@pytest.mark.parametrize(
    ("line", "units"),
    [
        ("nop", 2), (".pword 1", 2), (".word 1", 2), (".pspace 3", 2), ("call 0x100", 4), (".long 1", 4),
        (".int 1", 4),
        (".space 4", 4), ("do #3, .+6", 4), (".pword 1, 2", 4), (".2byte 1", 2), (".4byte 1", 4), (".byte 1, 2", 2),
        ('.ascii "abcd"', 4), ('.pascii "abcdef"', 4), (".hword 1", 2), (".short 1", 2), (".fill 3, 2, 1", 6),
    ],
)  # fmt: skip
def test_code_sections_advance_in_pc_units(asm, line, units):
    """In code sections the location counter advances in PC units, as the table of abi-elf.md §4.4 says."""
    assert asm(f"{line}\nend: nop\n").symbols["end"].value == units


def test_bytes_in_code_fill_low_then_middle_and_leave_the_upper_byte(asm):
    """In code sections .byte fills the low and then the middle byte of each word (abi-elf.md §4.4)."""
    assert asm(".byte 0x11,0x22,0x33\n .align 2\n nop\n").words() == [0x2211, 0x33, 0]


def test_packed_bytes_fill_all_three(asm):
    """.pbyte fills the low, middle and upper byte of each program word (abi-elf.md §4.4)."""
    assert asm(".pbyte 1,2,3,4\n .palign 2\n nop\n").words() == [0x030201, 0x000004, 0]


def test_labels_instructions_and_data_of_the_other_kind_begin_a_word(asm):
    """Labels, instructions and data of another kind align program memory implicitly; unused bytes are filled
    (pic30-as)."""
    out = asm('.byte 1\na: .byte 2\n .pbyte 3\n .byte 4\nb:\nc: nop\n .pasciz "abc"\nd: .pbyte 5\n')
    assert [out.symbols[n].value for n in "abcd"] == [2, 8, 8, 14]
    assert out.words() == [1, 2, 3, 4, 0, 0x636261, 0, 5]


def test_a_section_left_ends_its_word(asm):
    """A change of section completes the current program word (pic30-as: alignment is implicit)."""
    assert asm(".byte 1\n .data\n .byte 2\n .text\n .byte 3\n .section c,code\n .previous\n .pbyte 4\n").words() == [
        1,
        3,
        4,
    ]


def test_dot_among_bytes_of_a_word_is_that_word(asm):
    """Within a partly filled word `.` is the address of that word: the last valid program address (pic30-as)."""
    out = asm(".pword 7\n .byte 1\n .org . + 2\n .pbyte 2,3\n .org . + 4\n nop\n")
    assert out.words() == [7, 1, 0x0302, 0, 0]


def test_fillupper_sets_the_upper_byte_of_data_words(asm):
    """`.fillupper v` sets the upper byte of data words in program memory (abi-elf.md §4.3)."""
    assert asm(".fillupper 0x3F\n .word 0x1234\n .fillupper\n .word 1\n").words() == [0x3F1234, 1]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (".byte 1\n .align 2, 0x34\n", [0x003401]), (".byte 1\n .palign 2, 0x34\n", [0x343401]),
        (".fillvalue 0x34\n .fillupper 0x56\n .byte 1\n .align 2\n", [0x563401]),
        (".pfillvalue 0x34\n .byte 1\n .palign 4\n", [0x343401, 0x343434]),
        (".fillvalue 0x34\n .fillupper 0x56\n .org 4\n .byte 1\n", [0x563434, 0x563434, 0x563401]),
        (".porg 2, 0xAA\n .pfillvalue 0xFF\n .porg . + 2\n", [0xAAAAAA, 0xFFFFFF]),
        (".fillvalue 0x12\n .fill 2\n .pfillvalue 0x34\n .pfill 2\n .pspace 1\n", [0x1212, 0x343434]),
        (".byte 1\n .align 4, 0x34, 2\n .byte 2\n", [0x0201]), (".byte 1\n .align 4, 0x34, 0\n", [0x3401, 0x3434]),
        (".pbyte 1\n .palign 2, 0x34, 1\n .pbyte 2\n", [0x0201]), (".byte 1\n .align\n", [1]),
    ],
)  # fmt: skip
def test_fill_values_reach_every_byte_that_nothing_is_written_into(asm, text, words):
    """Fill values reach every unwritten byte (pic30-as).

    .fillvalue fills data, .fillupper the byte above, .pfillvalue all three bytes of .p directives.
    """
    assert asm(text).words() == words


def test_fill_values_are_of_their_section_and_of_code(asm):
    """A fill value applies to its own code section: `.fillvalue` in .text does not affect RAM (pic30-as)."""
    out = asm(
        ".fillvalue 0xFF\n .data\n .space 2\n .fill 2\n .bss\n .space 2\n .section b,code\n .fill 2\n .text\n .fill 2\n"
    )
    assert (out.bytes(".data"), out.words("b"), out.words()) == (bytes(4), [0], [0xFFFF])
    assert out.messages == []
    assert "no effect" in asm(".data\n .fillvalue 1\n").messages[0]


@pytest.mark.parametrize("move", [" . = . + 3", " .org . + 3", " .set ., . + 3", " .org x + 3", " . = 4"])
def test_the_location_counter_moves_relative_to_itself(asm, move):
    """Assigning to `.` moves the location counter like .org (GNU as)."""
    assert asm(f".data\n .byte 1\nx:\n{move}\ny: .byte 2\n").symbols["y"].value == 4


def test_data_sections_count_bytes_and_int_is_four_of_them(asm):
    """In data sections .int has four bytes (abi-elf.md §4.3) and a unit is one byte (§4.4)."""
    out = asm(
        '.data\n .byte 1\n .word 0x0302\n .int 0x07060504\n .asciz "a\\n"\n .single 1.0\n .double -2.0\n'
        " .fixed 0.5, -1.0\n"
    )
    expected = bytes(range(1, 8)) + b"a\n\0" + struct.pack("<fd", 1.0, -2.0) + struct.pack("<2h", 0x4000, -0x8000)
    assert out.bytes(".data") == expected


def test_objects_carry_a_phantom_octet_behind_every_data_byte(asm):
    """Objects store a phantom octet after each byte of RAM data and psv: b0, 0, b1, 0; sizes count octets
    (abi-elf.md §6.2)."""
    out = asm(".section .const,psv,page\n .byte 1, 2, 3\n")
    assert out.sections[".const"].data == bytes([1, 0, 2, 0, 3, 0])
    assert out.sections[".const"].units == 3


def test_align_and_org_count_from_the_section_start(asm):
    """.align and .org count from the start of the section (abi-elf.md §4.3, location directives)."""
    out = asm(".data\n .byte 1\n .align 4\nx: .byte 2\n .org 0x10, 0xEE\ny:\n")
    assert (out.symbols["x"].value, out.symbols["y"].value) == (4, 16)
    assert out.bytes(".data")[5:] == b"\xee" * 11
    assert out.sections[".data"].align == 4


def test_leb128_is_dwarfs(asm):
    """LEB128 encodings equal the examples of DWARF 2 §7.6, figures 22 and 23."""
    out = asm(".section .debug_x,info\n .uleb128 2, 127, 128, 12857\n .sleb128 2, -2, 127, -127, 128, -128\n")
    assert out.bytes(".debug_x").hex() == "027f8001b964" + "027eff00817f8001807f"


def test_bss_only_counts(asm):
    """A bss section has no content, but its size in the file is doubled, too (abi-elf.md §6.2)."""
    out = asm(".section .nbss,bss,near\nx: .space 10\n .bss\n .space 3\n")
    assert (out.sections[".nbss"].units, out.sections[".bss"].units, len(out.sections[".nbss"].data)) == (10, 3, 0)
    with pytest.raises(ToolError, match="only zero"):
        asm(".bss\n .word 1\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (".byte 256", "outside -128..255"), (".word 65536", "outside"), (".data\n .pword 1", "code section"),
        (" .org nowhere", "label of this section"), (".data\nx:\n .text\n . = x", "label of this section"),
        (".space -1", "cannot advance"), (".align 3", "power of two"), (".org 4\n .org 2", "before the current"),
        (".data\n nop", "not a code section"), (".space 0x7fffffff", "grows beyond"), (".fixed 1.0", "1.15"),
        (".uleb128 -1", "negative"), (".single x", "real number"), ('.ascii abc', "double quotes"),
        (".data\n .space 200000", "grows beyond"), (".fill 99999999999, 8, 1", "address space"),
    ],
)  # fmt: skip
def test_impossible_layouts_are_refused(asm, text, message):
    """Data and locations that a section cannot hold are refused (abi-elf.md §4.4)."""
    with pytest.raises(ToolError) as error:
        asm(text + "\n")
    assert message in str(error.value)
