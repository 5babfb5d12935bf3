"""Instructions through the whole assembler: vendor encodings, REPEAT and DO rules, caching."""

import csv
import re

import pytest

from toolchain.errors import ToolError


def test_everything_the_vendor_assembler_takes_gives_the_same_words(asm, vectors):
    """Every statement that the vendor's assembler accepts gives the same words (encodings.csv, rows marked `yes`)."""
    with open(vectors / "encodings.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["assembles"] == "yes"]
    expected = [int(row[key], 16) for row in rows for key in ("word1", "word2") if row[key]]
    assert len(rows) > 5000
    assert asm("\n".join(row["text"] for row in rows) + "\n").words() == expected


def test_word_accesses_to_odd_file_addresses_are_refused(asm, vectors):
    """Word accesses to odd file addresses are refused (encodings.csv, rows marked `no`; isa.md §3.3)."""
    with open(vectors / "encodings.csv", newline="") as file:
        texts = [row["text"] for row in csv.DictReader(file) if row["assembles"] == "no"]
    odd = [text for text in texts if re.fullmatch(r"\w+\.w 0x[0-9a-f]*[13579bdf](, WREG)?", text)]
    assert len(odd) > 300
    for text in odd[::5]:
        with pytest.raises(ToolError, match="odd"):
            asm(text + "\n")


def test_a_word_bit_above_seven_is_a_bit_of_the_next_byte(asm):
    """A word bit above 7 is a bit of the next byte: bset 0x1ffe,#15 accesses byte 0x1FFF, bit 7 (abi-elf.md §4.1)."""
    assert asm("bset 0x1ffe, #15\n bset.b 0x1fff, #7\n").words() == [0xA8FFFF, 0xA8FFFF]


@pytest.mark.parametrize("line", ["mov #-32769, w0",
                                  "mov #65536, w0", "mov.b #256, w0", "mov.b #-129, w0", "add w0, #32, w1",
                                  "add #1024, w0", "mov [w0+3], w1", "mov [w0+1024], w1", "mov.b [w0+512], w1",
                                  "repeat #16384", "lnk #3", "lnk #16384"])  # fmt: skip
def test_literals_out_of_range_are_errors_never_expanded(asm, line):
    """A literal out of range is an error; the assembler never expands an instruction (abi-elf.md §4.1)."""
    with pytest.raises(ToolError):
        asm(line + "\n")


@pytest.mark.parametrize(
    "line",
    ["bra x", "call x", "cpseq w0, w1", "cpsgt w0, w1", "cpslt w0, w1", "cpsne w0, w1", "disi #3", "do #3, x", "goto x",
     "lnk #4", "mov.d w0, w2", "pwrsav #0", "rcall x", "repeat #3", "reset", "retfie", "retlw #0, w0", "return",
     "ulnk"],
)  # fmt: skip
def test_what_must_not_be_repeated_is_refused(asm, line):
    """An instruction that must not follow REPEAT is refused there (isa.md §16)."""
    with pytest.raises(ToolError, match="cannot be repeated"):
        asm(f"repeat #4\nx: {line}\n nop\n nop\n")


def test_what_may_be_repeated_is_accepted(asm):
    """Instructions that REPEAT permits are accepted (isa.md §7.5); data or another section may also follow."""
    assert (
        len(
            asm(
                "repeat #17\n div.sw w0, w2\n repeat #4\n mov [w0++], [w1++]\n repeat #3\n .data\n .text\n return\n"
            ).words()
        )
        == 6
    )


def test_the_same_statement_means_another_thing_after_an_equate_changes(asm):
    """A statement is encoded with the present values of its symbols, although parsed statements are cached by text."""
    out = asm("k = 1\n mov #k, w0\n bset w0, #k\nk = 2\n mov #k, w0\n bset w0, #k\n mov #late, w1\nlate = 5\n")
    assert out.words() == [0x200010, 0xA01000, 0x200020, 0xA02000, 0x200051]


def test_a_number_known_late_is_checked_like_one_known_early(asm):
    """A value that is only known at the end of the file is checked against the same range as an early one."""
    with pytest.raises(ToolError, match="outside"):
        asm("add w0, #late, w1\nlate = 32\n")
    assert asm("call late\nlate = 0x12346\n").words() == [0x022346, 1]


def test_equates_may_name_working_registers(asm):
    """An equate may name a working register (pic30-as), as DSP sources do."""
    named = asm(
        ".equ xW, w10\n .set yW, w11\nsumW = W4\n .equ facW, W5\n .equiv sameW, sumW\n .ifdef sumW\n nop\n .endif\n"
        " mov [xW++], sumW\n mov.b [xW+sumW], [yW+sumW]\n mac sumW*facW, A, [w8]+=2, sumW, [yW]+=2, facW\n"
        " mul.uu sameW, facW, w0\n mov #'x', xW\n mov [w14-4], w0\n .set xW, 7\n mov #xW, w1\n"
    )
    plain = asm(
        " nop\n mov [w10++], w4\n mov.b [w10+w4], [w11+w4]\n mac w4*w5, A, [w8]+=2, w4, [w11]+=2, w5\n"
        " mul.uu w4, w5, w0\n mov #'x', w10\n mov [w14-4], w0\n mov #7, w1\n"
    )
    assert named.words() == plain.words()
    assert not {"xW", "sumW", "w10"} & set(named.symbols)


@pytest.mark.parametrize(
    "text",
    [".equ a, w1\na: nop\n", "a: nop\n .equ a, w1\n", ".equ a, w1\n .equiv a, w2\n", " mov a, w0\n .equ a, w1\n"],
)
def test_a_name_is_a_register_s_or_a_symbol_s(asm, text):
    with pytest.raises(ToolError, match="symbol a is already"):
        asm(text)
