"""`ld --part`: a program that another image calls occupies one range of program memory and one of RAM only."""

from __future__ import annotations

import pytest

from emu.chips.chip import Region
from toolchain.errors import ToolError
from toolchain.link.command import link_options, parse_link_words
from toolchain.link.options import PartRegions

PART = PartRegions(Region("program", 0xF800, 0x10000), Region("data", 0x0800, 0x0900))
START = ".section .text,code\n.global __reset\n__reset: return\n"


def test_everything_lies_in_the_part_and_nothing_elsewhere(image):
    """All code and data of a part are in its ranges; it has no vectors, reset vector or default handler.

    RAM is allocated from the start of the range.
    """
    out = image(START, ".global _v\n.section .nbss,bss,near\n_v: .space 4\n.text\n mov _v, w0\n", part=PART)
    loaded = {s.name: (s.load, s.load + s.units) for s in out.linked.image.sections if s.is_code}
    assert set(loaded) <= {".text", ".dinit"}
    assert all(0xF800 <= first < end <= 0x10000 for first, end in loaded.values())
    assert out.symbols["_v"] == 0x0800


def test_constants_are_initialised_data(image):
    """Constants of a part are initialised data in RAM, because the PSV window belongs to the caller."""
    const = ".section .const,psv\n.global _c\n_c: .word 0x1234\n.text\n mov _c, w0\n"
    out = image(START, const, part=PART, pack_data=False)
    assert out.symbols["_c"] == 0x0800
    (table,) = [s for s in out.linked.image.sections if s.name == ".dinit"]
    words = [int.from_bytes(table.data[at : at + 3], "little") for at in range(0, len(table.data), 4)]
    assert words == [0x0800, 2, 1, 0x1234, 0]
    assert image(START, const).symbols["_c"] >= 0x8000


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (".section .much,code\n.space 0x800\n", "program memory 0xf800..0xffff overflows by"),
        (".section .bss,bss\n.space 0x102\n", "data memory 0x800..0x8ff overflows by 2 bytes"),
        (".global __T1Interrupt\n.text\n__T1Interrupt: retfie\n", "__T1Interrupt is a handler of interrupts"),
        (".section __FOSC.sec,code\n.pword 0\n", "a program that another image calls has no configuration words"),
        (".section e,eedata\n.word 1\n", "another image calls has no contents of the data EEPROM"),
    ],
)
def test_what_a_part_may_not_have(image, text, message):
    with pytest.raises(ToolError) as error:
        image(START, text, part=PART)
    assert message in str(error.value)


@pytest.mark.parametrize("words", ["", "0xF800-0xFFFF", "0xF801-0xFFFF,0x800-0x8FF", "0x100-0x18001,2048-2303",
                                   "0xF800-0xFFFF,0x700-0x8FF", "0xF800-0xF7FF,0x800-0x8FF", "x-y,1-2"])  # fmt: skip
def test_ranges_that_are_none(words):
    with pytest.raises(ToolError, match="--part"):
        link_options(parse_link_words([f"--part={words}"]))


def test_ranges_are_read_as_written():
    part = link_options(parse_link_words(["--part=0xF800-0xFFFF,2048-0x8FF"])).part
    assert part is not None
    assert (part.program.start, part.program.end, part.data.start, part.data.end) == (0xF800, 0x10000, 0x800, 0x900)
