"""`emu footprint`, static part: every byte is counted once and belongs to a name."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from emu.cli import main
from emu.commands.info import describe
from emu.image.footprint import UNKNOWN, pieces, totals
from emu.image.loader import parse_image
from tests.emu.loader.dwarf_samples import debug_sections
from tests.emu.loader.elf_samples import Name, xc16_like


@pytest.fixture
def image():
    sample = xc16_like()
    sample.parts += debug_sections()
    sample.names.append(Name("_printf_field", 0x202, 3, size=2, kind=2))
    return parse_image(sample.build(), "firmware.elf")


@pytest.mark.parametrize("key", ["module", "kind", "name", "group"])
def test_every_grouping_adds_up_to_what_info_counts(image, key):
    memory = describe(image)["memory"]
    table = totals(pieces(image), key)
    assert sum(rom for rom, _ in table.values()) == memory["flash_bytes"]
    assert sum(ram for _, ram in table.values()) == memory["ram_bytes"]


def test_rom_belongs_to_the_symbol_before_it_and_ram_to_its_own(image):
    table = totals(pieces(image), "name")
    assert table["_main"] == (9, 0)
    assert table["__reset"] == (6, 0)
    assert table["_helper"] == (3, 0)
    assert table["_table"] == (6, 0)
    assert table["_counter"] == (0, 2)
    assert table["_buffer"] == (0, 4)
    assert table[".ivt"] == (186, 0)


def test_a_word_shared_by_two_constants_is_counted_once(image):
    """A program word whose bytes belong to two constants is counted once. Strings follow each other at odd addresses
    in the PSV window (abi-elf.md §1.1)."""
    sample = xc16_like()
    sample.names.append(Name("_text", 0x8181, 4, size=3, kind=1))
    table = totals(pieces(parse_image(sample.build(), "x.elf")), "name")
    assert table["_table"] == (3, 0)
    assert table["_text"] == (3, 0)


def test_source_files_come_from_the_line_table(image):
    """The line table assigns code to source files; the sample's table covers three words, 0x104..0x10A."""
    table = totals(pieces(image), "module")
    assert table["src/main.c"] == (9, 0)
    assert set(table) == {"src/main.c", UNKNOWN}


def test_start_up_vectors_and_printf_are_distinguished(image):
    table = totals(pieces(image), "group")
    assert table["vectors"] == (186, 0)
    assert table["start-up"] == (6 + 6, 0)
    assert table["printf"] == (3, 0)


def test_the_command_prints_sizes_with_and_without_start_up(tmp_path, capsys):
    path = tmp_path / "firmware.elf"
    path.write_bytes(xc16_like().build())
    assert main(["footprint", str(path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["rom"] - facts["without_start_up"]["rom"] == 186 + 12
    assert main(["footprint", str(path)]) == 0
    assert "ROM 219 bytes, RAM 6 bytes" in capsys.readouterr().out


def test_a_hex_file_is_refused_with_the_reason(capsys):
    assert main(["footprint", str(Path(__file__).with_name("hello.hex"))]) == 2
    assert "give the ELF file" in capsys.readouterr().err
