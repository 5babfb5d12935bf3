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
    """Numbers and operators have the values of abi-elf.md §4.1; a true comparison is -1, as in GNU as.

    Forms of numbers: decimal, 0x, 0b, leading 0 and 'A'.
    """
    assert value(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"), [("1 + 2 & 1", 1), ("8 | 1 + 1", 10), ("6 & 3 << 1", 6), ("1 + 1 == 2", -1)]
)
def test_bit_operators_bind_tighter_than_plus_as_in_gnu_as(text, expected):
    """Unlike in C, | & ^ bind tighter than + -, and comparisons bind less tightly than + - (GNU as 2.14)."""
    assert value(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("tbloffset(0x12345)", 0x2345), ("tblpage(0x12345)", 1), ("psvoffset(0x12345)", 0xA345),
        ("psvpage(0x12345)", 2), ("paddr(0x12345)", 0x12345),
    ],
)  # fmt: skip
def test_address_operators_apply_to_plain_numbers(text, expected):
    """Address operators may be applied to plain numbers (abi-elf.md §4.2, absolute targets)."""
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
    """A malformed expression is refused with a message that names the mistake; lo() and hi() do not exist (§4.2).

    Source: abi-elf.md.
    """
    with pytest.raises(ExprError, match=None) as error:
        value(text)
    assert message in str(error.value)


def test_labels_in_one_section_have_a_distance_before_the_end_of_the_file(asm):
    """The difference of two labels of a section is a number; with forward labels it is resolved at the end of the
    file."""
    out = asm(".data\na: .word b - a, (b - a) / 2, . - a\n .space 4\nb:\n")
    assert out.bytes(".data")[:6] == bytes([10, 0, 5, 0, 4, 0])


def test_equates_may_be_set_again_and_keep_the_value_they_had_at_each_use(asm):
    """.set and = may redefine a symbol, .equiv may not; each use has the value at that point."""
    out = asm(".data\nx = 1\n .word x\n .set x, x + 1\n .word x\n .equ x, 9\n .word x\n")
    assert out.bytes(".data") == bytes([1, 0, 2, 0, 9, 0])
    with pytest.raises(ToolError, match="already defined"):
        asm(".equiv y, 1\n .equiv y, 2\n")


def test_an_equate_to_a_label_is_a_symbol_in_its_section(asm):
    """A symbol equated to a label is a symbol of the label's section and can be exported."""
    out = asm(".global b\na: nop\n nop\nb = a + 2\n")
    assert (out.symbols["b"].section.name, out.symbols["b"].value) == (".text", 2)


def test_a_difference_across_sections_is_refused(asm):
    """A difference of labels in different sections is refused: no relocation type expresses it (abi-elf.md §5)."""
    with pytest.raises(ToolError, match="neither a constant"):
        asm(".data\na: .word a - b\n .text\nb: nop\n")


def test_section_limits_become_symbols_the_linker_resolves(asm):
    """.startof.(sec), .sizeof.(sec) and .endof.(sec) become symbols that the linker resolves (abi-elf.md §4.2)."""
    out = asm(" mov #.startof.(.nbss), w0\n mov #.sizeof.(.nbss), w1\n")
    assert [name for _, _, name in out.relocs()] == [".startof..nbss", ".sizeof..nbss"]
