"""Relocation numbers, fields and addends of assembled objects (abi-elf.md §5)."""

import pytest

from toolchain.errors import ToolError


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("inc.b sym", [(0, 4)]), ("bset sym, #3", [(0, 4)]), ("inc sym", [(0, 5)]), ("push sym", [(0, 6)]),
        ("pop sym", [(0, 6)]), ("mov sym, w3", [(0, 7)]), ("mov w3, sym", [(0, 7)]), ("mov #sym, w3", [(0, 8)]),
        (".byte sym", [(0, 1)]), (".word sym", [(0, 2)]), (".long sym", [(0, 3)]), (".pbyte sym", [(0, 9)]),
        (".pword sym", [(0, 10)]), (".word handle(sym)", [(0, 11)]), ("mov #handle(sym), w0", [(0, 16)]),
        (".pword handle(sym)", [(0, 25)]), (".long paddr(sym)", [(0, 12)]), (".pword paddr(sym)", [(0, 13)]),
        (".word psvoffset(sym)", [(0, 14)]), ("mov #psvoffset(sym), w0", [(0, 17)]),
        (".pword psvoffset(sym)", [(0, 26)]),
        (".word tbloffset(sym)", [(0, 15)]), ("mov #tbloffset(sym), w0", [(0, 21)]),
        (".pword tbloffset(sym)", [(0, 27)]),
        (".word psvpage(sym)", [(0, 18)]), ("mov #psvpage(sym), w0", [(0, 20)]), (".word tblpage(sym)", [(0, 22)]),
        ("mov #tblpage(sym), w0", [(0, 24)]), ("bra sym", [(0, 28)]), ("bra nz, sym", [(0, 28)]),
        ("rcall sym", [(0, 28)]),
        ("bra 0x200", [(0, 29)]), ("do #3, sym", [(4, 30)]), ("call sym", [(0, 32), (4, 33)]),
        ("goto sym", [(0, 32), (4, 33)]), ("sl w0, #sym, w1", [(0, 34)]), ("add w0, #sym, w1", [(0, 35)]),
        ("bset w0, #sym", [(0, 38)]), ("sftac A, #sym", [(0, 39)]), ("lac w0, #sym, A", [(0, 40)]),
        ("add.b #sym, w0", [(0, 41)]), ("add #sym, w0", [(0, 42)]), ("repeat #sym", [(0, 43)]),
        ("disi #sym", [(0, 43)]),
        ("lnk #sym", [(0, 44)]), ("pwrsav #sym", [(0, 45)]), ("mov #edspage(sym), w0", [(0, 61)]),
        ("mov #edsoffset(sym), w0", [(0, 64)]), ("add #tblpage(sym), w0", [(0, 74)]),
    ],
)  # fmt: skip
def test_each_field_gets_its_relocation(asm, line, expected):
    """Each instruction or data field gets its relocation (abi-elf.md §5, table).

    The pairing is [verified] there for all but 9, 10, 25, 26, 29, 74.
    """
    assert asm(line + "\n").relocs() == [(offset, number, asm_symbol(line)) for offset, number in expected]


def asm_symbol(line):
    return ".LA200" if "0x200" in line else "sym"


def test_offsets_count_file_octets(asm):
    """Relocation offsets count file octets: 4 per instruction, 2 per data byte (abi-elf.md §5).

    Data in code sections skip the upper octets.
    """
    assert [o for o, _, _ in asm("nop\n call x\n mov #x, w0\n").relocs()] == [4, 8, 12]
    assert [o for o, _, _ in asm(".data\n .byte 1, 2\n .word x, x\n").relocs(".data")] == [4, 8]
    assert [o for o, _, _ in asm(".byte 1\n .word x\n .byte x\n").relocs()] == [1, 5]


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("bra sym+4", 0x370004), ("bra sym-2", 0x37FFFE), ("mov sym+6, w1", 0x800031), ("mov #sym-1, w0", 0x2FFFF0),
        ("inc sym+2", 0xEC2002), ("bset sym+4, #9", 0xA82005), ("add #sym+5, w2", 0xB00052),
        ("mov #psvoffset(sym)+3, w0", 0x200030), ("mov #psvoffset(sym+3), w0", 0x200030),
    ],
)  # fmt: skip
def test_the_field_contains_the_addend(asm, line, word):
    """The addend is stored in the field (abi-elf.md §5).

    Branches store it in PC units, MOV f in words. A bit number above 7 selects a bit of the next byte.
    """
    assert asm(line + "\n").words() == [word]


def test_local_branches_stay_relocations_with_an_empty_field(asm):
    """All branches remain relocations with an empty field, even local ones (abi-elf.md §5)."""
    out = asm("a: nop\n bra a\n bra 1f\n1: nop\n")
    assert out.words() == [0, 0x370000, 0x370000, 0]
    assert [n for _, n, _ in out.relocs()] == [28, 28]


def test_branches_relative_to_themselves_need_no_relocation(asm):
    """A branch to `.+4` needs no relocation: the target is PC + 2 + 2n (isa.md §3.2)."""
    out = asm("bra .+4\n bra .\n rcall $-2\n do #1, .+6\n")
    assert out.words() == [0x370001, 0x37FFFF, 0x07FFFE, 0x080001, 1]
    assert out.relocs() == []


def test_a_call_with_an_offset_names_a_label_of_its_own(asm):
    """A call with an offset refers to a new label without addend (abi-elf.md §5, 33).

    The addend of word 1 would not carry into word 2.
    """
    out = asm("f: nop\n nop\n call f+2\n")
    (_, lsb, name), (_, msb, same) = out.relocs()
    assert (lsb, msb, name, out.symbols[name].value) == (32, 33, same, 2)
    with pytest.raises(ToolError, match="define a label"):
        asm("call elsewhere+2\n")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("mov #code, w0", "executable symbol"), (".word code", "executable symbol"),
        ("mov #tbloffset(data), w0", "data section"),
        ("mov #handle(data), w0", "needs a function"), (".byte tbloffset(code)", "cannot be stored"),
        (".long tbloffset(code)", "cannot be stored"), (".word paddr(code)", "cannot be stored"),
        ("mov tbloffset(code), w0", "cannot be used"), ("lnk #tbloffset(code)", "cannot be used"),
        ("mov [w0+sym], w1", "number"), ("mov sym+1, w0", "even"), ("bra code+3", "even"),
        ("bra code+0x10000", "fit"),
        ("do #1, .", "shorter"), ("do #1, .+2", "shorter"), ("do #1, .+4", "shorter"),
        ("add w0, #code+40, w1", "field"),
    ],
)  # fmt: skip
def test_meaningless_references_are_refused(asm, line, message):
    """References without meaning are refused: targets beyond abi-elf.md §4.2, and DO lengths -2, -1, 0 (§5)."""
    with pytest.raises(ToolError) as error:
        asm(f"code: {line}\n nop\n .data\ndata: .word 0\n")
    assert message in str(error.value)


def test_info_sections_may_hold_code_addresses(asm):
    """Debug sections may contain code addresses, with relocation 32 or 16 (abi-elf.md §6.7)."""
    out = asm("f: nop\n .section .debug_line,info\n .4byte f\n .2byte f\n")
    assert out.relocs(".debug_line") == [(0, 3, "f"), (8, 2, "f")]
