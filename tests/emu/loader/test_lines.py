"""Source lines from DWARF with phantom bytes."""

from __future__ import annotations

import dataclasses

import pytest

from emu.image.lines import remove_phantom_octets
from emu.image.loader import parse_image
from tests.emu.loader.dwarf_samples import debug_sections
from tests.emu.loader.elf_samples import doubled, xc16_like


def image_with(parts):
    sample = xc16_like()
    sample.parts += parts
    return parse_image(sample.build(), "sample.elf")


@pytest.mark.parametrize("plain", [False, True])
def test_addresses_map_to_file_and_line(plain):
    """abi-elf.md §6.7: addresses map to file and line, for DWARF with phantom bytes and for standard DWARF."""
    parts = debug_sections()
    if plain:
        parts = [dataclasses.replace(part, content=part.content[::2]) for part in parts]
    lines = image_with(parts).lines
    assert [str(lines.find(pc)) for pc in (0x104, 0x106, 0x108)] == ["src/main.c:10", "src/main.c:12", "src/main.c:12"]
    assert lines.find(0x102) is None
    assert lines.find(0x10A) is None


def test_an_image_without_dwarf_has_no_lines():
    lines = image_with([]).lines
    assert len(lines) == 0
    assert lines.find(0x104) is None


def test_one_value_in_a_phantom_does_not_stop_the_un_doubling():
    """abi-elf.md §6.7: phantom bytes are removed although one is not 0: that of DW_AT_language in assembler units
    holds its high byte."""
    octets = bytearray(doubled(bytes(range(1, 200))))
    octets[9] = 0x80
    assert remove_phantom_octets({".debug_info": bytes(octets)})[".debug_info"] == bytes(range(1, 200))


def test_plain_lists_of_small_addresses_are_not_taken_for_doubled_ones():
    """Lists of small addresses in standard DWARF are not taken for data with phantom bytes, because only sections
    with text decide."""
    sections = {".debug_info": b"\1main.c\0main\0", ".debug_ranges": bytes([2, 0, 4, 0, 0, 0, 0, 0])}
    assert remove_phantom_octets(sections) == sections


def test_unreadable_dwarf_is_ignored():
    parts = debug_sections()
    parts[0] = dataclasses.replace(parts[0], content=parts[0].content[:12])
    lines = image_with(parts).lines
    assert (len(lines), lines.files) == (0, {})
