"""A value known to the assembler at once, at the end of the file, or to the linker only, gives the same word."""

import pytest

from emu.image.elf_facts import RELOCATIONS
from toolchain.asm.assemble import assemble
from toolchain.elf.read import read_object
from toolchain.elf.write import object_bytes
from toolchain.errors import ToolError
from toolchain.link.link import link
from toolchain.link.options import LinkOptions

CASES = [
    ("inc.b v", (0, 0x85, 0x1FFF)), ("inc v", (0, 0x84, 0x1FFE)), ("bset.b v, #3", (0, 0x1FFF)),
    ("bset v, #11", (0, 0x1FFE)),
    ("push v", (0, 0x36, 0xFFFE)), ("pop v", (0x36,)), ("mov v, w3", (0, 0xFFFE)), ("mov w7, v", (0x800, 0x27FE)),
    ("mov #v, w9", (0, -1, 0xFFFF, -0x8000)), ("mov.b #v, w2", (-128, 255)), ("add.b #v, w1", (-1, 255)),
    ("add #v, w1", (0, 1023)), ("sub w1, #v, w2", (0, 31)), ("sl w1, #v, w2", (0, 15)), ("asr w1, #v, w2", (7,)),
    ("bset w3, #v", (0, 15)), ("bclr.b w3, #v", (0, 7)), ("btst.c [w3++], #v", (9,)), ("cp w0, #v", (31,)),
    ("repeat #v", (0, 16383)), ("do #v, .+6", (16383,)), ("disi #v", (5,)), ("lnk #v", (0, 16382)),
    ("pwrsav #v", (0, 1)),
    ("retlw #v, w0", (0, 1023)), ("retlw.b #v, w0", (255,)), ("sftac A, #v", (-16, 16)), ("lac w0, #v, B", (-8, 7)),
    ("sac.r A, #v, [w1++]", (-8, 7)), ("mul.uu w2, #v, w4", (31,)), ("mov #tbloffset(v), w0", (0x12345,)),
    ("mov #tblpage(v), w0", (0x12345,)), ("mov #psvoffset(v), w0", (0x12345,)), ("mov #psvpage(v), w0", (0x17FFE,)),
    ("add #tblpage(v), w0", (0x12345,)), ("call v", (0x100, 0x17FFE)), ("goto v", (0x12344,)),
    (".word v", (-1, 0xFFFF)),
    (".byte v, 1", (-1, 255)), (".long v", (-1, 0x12345678)), (".pword v", (0xABCDEF,)), (".pbyte v, 2, 3", (7,)),
    (".word tbloffset(v), psvpage(v)", (0x12346,)), (".pword paddr(v)", (0x12346,)), (".long paddr(v)", (0x12346,)),
]  # fmt: skip


def words(*sources):
    objects = [read_object(object_bytes(assemble(text, f"{i}.s")[0]), f"{i}.o") for i, text in enumerate(sources)]
    image = link(objects, [], LinkOptions()).image
    return next(bytes(s.data) for s in image.sections if s.name == "code")


@pytest.mark.parametrize(("line", "values"), CASES)
def test_early_late_and_linked_values_agree(line, values):
    """Values bound early, late or at link time give equal words.

    The fields of abi-elf.md §5 and the bit patterns of isa.md §5 are independent descriptions.
    """
    body = f" .global __reset\n .section code,code,address(0x1000)\n__reset: {line}\n nop\n"
    for value in values:
        early = words(f"v = {value}\n{body}")
        assert words(f"{body}\n.equ v, {value}\n") == early
        assert words(body, f" .global v\nv = {value}\n") == early


NEVER = [line for line, _ in CASES if "(" not in line and not line.startswith(".long")]


@pytest.mark.parametrize("line", NEVER)
def test_a_value_that_never_fits_is_refused_at_each_time(line):
    """Assembler and linker report a value that is out of range instead of truncating it."""
    body = f" .global __reset\n .section code,code,address(0x1000)\n__reset: {line}\n nop\n"
    for sources in ((f"v = 0x7654320\n{body}",), (f"{body}\nv = 0x7654320\n",), (body, " .global v\nv = 0x7654320\n")):
        with pytest.raises(ToolError):
            words(*sources)


def test_the_cases_cover_the_relocations_of_instructions():
    """The cases cover every instruction relocation except those of branches, whose operands are labels."""
    seen = set()
    for line, _ in CASES:
        seen |= {r.type for s in assemble(f" .section c,code\n {line}\n nop\n", "x.s")[0].sections for r in s.relocs}
    missing = {kind.name.removeprefix("R_PIC30_") for number, kind in RELOCATIONS.items() if number not in seen}
    unused = {
        n
        for n in missing
        if n.startswith(("UNSIGNED_10_", "ADDR_", "P_", "WORD_ADDR", "WORD_EDS", "EDS", "WORD_HANDLE"))
    }
    assert missing - unused == {
        "NONE", "HANDLE", "PSVOFFSET", "TBLPAGE", "PCREL_BRANCH", "BRANCH_ABSOLUTE", "PCREL_DO", "DO_ABSOLUTE",
        "BIT_SELECT_3",
    }  # fmt: skip
