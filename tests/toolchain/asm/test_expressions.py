"""Expressions of the assembler (abi-elf.md §4.1, §4.2; operator ranks of GNU as 2.14)."""

import pytest

from toolchain.asm.expr import ExprError, evaluate, parse
from toolchain.errors import ToolError


def value(text):
    return evaluate(parse(text), lambda name: pytest.fail(name), lambda: pytest.fail("."))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("10", 10), ("0x1F", 31), ("0b101", 5), ("017", 15), ("'A'", 65), ("'A", 65), (r"'\n'", 10), ("';'", 59),
        ("-3", -3), ("~0", -1), ("!0", 1), ("!7", 0), ("- - 4", 4), ("(2)", 2),
        ("2+3*4", 14), ("2*3+4", 10), ("7/2", 3), ("-7/2", -3), ("-7%2", -1), ("1<<4", 16), ("0x100>>4", 16),
        ("1 == 1", -1), ("1 <> 1", 0), ("1 != 2", -1), ("2 < 1", 0), ("2 >= 2", -1), ("1 && 2", 1), ("0 || 3", 1),
        ("0xFF & 0x0F | 0x30", 0x3F), ("5 ! 0", -1),
    ],
)  # fmt: skip
def test_numbers_and_operators_have_their_value(text, expected):
    """abi-elf.md §4.1: decimal, 0x, 0b, leading 0, 'A'; comparisons are -1 when true, as in GNU as."""
    assert value(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"), [("1 + 2 & 1", 1), ("8 | 1 + 1", 10), ("6 & 3 << 1", 6), ("1 + 1 == 2", -1)]
)
def test_bit_operators_bind_tighter_than_plus_as_in_gnu_as(text, expected):
    """GNU as 2.14: | & ^ rank above + - and comparisons, unlike C; comparisons rank below + -."""
    assert value(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("tbloffset(0x12345)", 0x2345), ("tblpage(0x12345)", 1), ("psvoffset(0x12345)", 0xA345),
        ("psvpage(0x12345)", 2), ("paddr(0x12345)", 0x12345),
    ],
)  # fmt: skip
def test_address_operators_apply_to_plain_numbers(text, expected):
    """abi-elf.md §4.2, absolute targets."""
    assert value(text) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("lo(1)", "& 0xFFFF"), ("hi(1)", ">> 16"), ("frob(1)", "unknown operator"), ("1/0", "division by zero"),
        ("1 +", "ends too early"), ("", "missing"), ("(1", "expected ')'"), ("1 2", "unexpected"), ("09", "octal"),
        ("1 << 99", "0..63"), ("handle(5)", "needs a symbol"), ("(" * 100 + "1", "nested"), ("1 ? 2", "cannot read"),
    ],
)  # fmt: skip
def test_bad_expressions_say_what_is_wrong(text, message):
    """abi-elf.md §4.2: lo() and hi() are rejected by this assembler."""
    with pytest.raises(ExprError, match=None) as error:
        value(text)
    assert message in str(error.value)


def test_labels_in_one_section_have_a_distance_before_the_end_of_the_file(asm):
    """A difference of labels is a number; differences with forward labels are resolved at the end."""
    out = asm(".data\na: .word b - a, (b - a) / 2, . - a\n .space 4\nb:\n")
    assert out.bytes(".data")[:6] == bytes([10, 0, 5, 0, 4, 0])


def test_equates_may_be_set_again_and_keep_the_value_they_had_at_each_use(asm):
    """.set and = redefine; .equiv does not."""
    out = asm(".data\nx = 1\n .word x\n .set x, x + 1\n .word x\n .equ x, 9\n .word x\n")
    assert out.bytes(".data") == bytes([1, 0, 2, 0, 9, 0])
    with pytest.raises(ToolError, match="already defined"):
        asm(".equiv y, 1\n .equiv y, 2\n")


def test_an_equate_to_a_label_is_a_symbol_in_its_section(asm):
    """Aliases can be exported."""
    out = asm(".global b\na: nop\n nop\nb = a + 2\n")
    assert (out.symbols["b"].section.name, out.symbols["b"].value) == (".text", 2)


def test_a_difference_across_sections_is_refused(asm):
    """No relocation type expresses it (abi-elf.md §5)."""
    with pytest.raises(ToolError, match="neither a constant"):
        asm(".data\na: .word a - b\n .text\nb: nop\n")


def test_section_limits_become_symbols_the_linker_resolves(asm):
    """abi-elf.md §4.2: .startof.(sec) .sizeof.(sec) .endof.(sec)."""
    out = asm(" mov #.startof.(.nbss), w0\n mov #.sizeof.(.nbss), w1\n")
    assert [name for _, _, name in out.relocs()] == [".startof..nbss", ".sizeof..nbss"]
