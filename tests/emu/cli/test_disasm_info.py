"""`emu disasm` and `emu info` on a synthetic executable with XC16's layout."""

from __future__ import annotations

import json

import pytest

from emu.cli import main
from tests.emu.loader.dwarf_samples import debug_sections
from tests.emu.loader.elf_samples import xc16_like


@pytest.fixture
def firmware(tmp_path):
    sample = xc16_like()
    sample.parts += debug_sections()
    path = tmp_path / "firmware.elf"
    path.write_bytes(sample.build())
    return str(path)


def output(capsys, *arguments, status=0):
    assert main(arguments) == status
    return capsys.readouterr()


def test_disassembly_shows_labels_lines_and_named_targets(firmware, capsys):
    text = output(capsys, "disasm", firmware).out
    assert "000100 <__reset>:" in text
    assert "src/main.c:10" in text
    assert "040100 000000  goto __reset" in text
    assert ".pword 0x000108 ; T1Interrupt -> _main+0x4" in text
    assert "37ffff         bra _helper+0x2" in text


def test_constants_are_shown_as_data(firmware, capsys):
    assert "010180  00bbaa         .pword 0x00bbaa" in output(capsys, "disasm", firmware).out


def test_one_function_is_shown_whole_and_alone(firmware, capsys):
    text = output(capsys, "disasm", firmware, "--from", "helper").out
    assert [line.split()[0] for line in text.splitlines() if line.startswith("  ")] == ["000200", "000202"]


def test_disassembly_as_json_has_one_object_per_instruction(firmware, capsys):
    lines = output(capsys, "disasm", firmware, "--from", "0x100", "--to", "0x104", "--json").out.splitlines()
    assert [json.loads(line)["address"] for line in lines] == [0x100, 0x102]
    assert json.loads(lines[0]) == {
        "address": 0x100, "words": [0x200010], "text": "mov.w #0x1, w0", "symbol": "__reset", "line": None,
    }  # fmt: skip


def test_source_text_is_shown_where_the_file_is_found(firmware, capsys, tmp_path, monkeypatch):
    source = tmp_path / "src" / "main.c"
    source.parent.mkdir()
    source.write_text("\n" * 9 + "    int x = 1;\n")
    monkeypatch.chdir(tmp_path)
    assert "src/main.c:10: int x = 1;" in output(capsys, "disasm", firmware, "--source").out


@pytest.mark.parametrize(("name", "expected"), [("nowhere", "not in the program"), ("counter", "data memory")])
def test_a_place_that_is_no_code_is_refused(firmware, capsys, name, expected):
    assert expected in output(capsys, "disasm", firmware, "--from", name, status=2).err


@pytest.mark.parametrize(("first", "last"), [("0x102", "0x100"), ("0x102", "0x102")])
def test_a_range_that_holds_nothing_is_refused(firmware, capsys, first, last):
    told = output(capsys, "disasm", firmware, "--from", first, "--to", last, status=2)
    assert told.err == f"emu disasm: --to {last} must be above the first address, 0x102\n"


def test_info_counts_memory_as_the_sections_say(firmware, capsys):
    """`emu info` counts 3 bytes of flash per program word, and RAM from data and bss sections."""
    facts = json.loads(output(capsys, "info", firmware, "--json").out)
    memory = facts["memory"]
    assert memory["flash_words"] == 2 + 62 + 5 + 2 + 2
    assert memory["flash_bytes"] == 3 * memory["flash_words"]
    assert memory["flash_bytes_total"] == 147456
    assert (memory["ram_bytes"], memory["ram_bytes_total"]) == (6, 8192)
    assert memory["eeprom_bytes"] == 2
    assert facts["config"] == [
        {"name": "FOSC", "address": 0xF80000, "value": 0xC706, "fields": {"FCKSM": 3, "FOS": 7, "FPR": 6}}
    ]
    assert len(facts["vectors"]) == 62


def test_info_for_people_names_sections_and_config(firmware, capsys):
    text = output(capsys, "info", firmware).out
    assert ".ndata" in text
    assert "FOSC     0xf80000  0xc706  FCKSM=3 FOS=7 FPR=6" in text


@pytest.mark.parametrize("command", ["info", "disasm"])
def test_bad_input_is_one_line_and_status_2(command, capsys, tmp_path):
    path = tmp_path / "x.elf"
    path.write_bytes(b"\x7fELF")
    captured = output(capsys, command, str(path), status=2)
    assert captured.out == ""
    assert (
        captured.err
        == f"emu {command}: {path}: is truncated: the ELF header needs octets 0x0..0x34, the file has 0x4\n"
    )


def test_usage_mistakes_are_one_line_and_status_2(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["info"])
    assert caught.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert output(capsys, "no-such", status=2).err.startswith("emu: unknown command 'no-such'; known: run")


@pytest.mark.parametrize("command", ["info", "disasm"])
def test_help_has_an_example(command, capsys):
    with pytest.raises(SystemExit) as caught:
        main([command, "--help"])
    assert caught.value.code == 0
    assert f"example: emu {command} firmware.elf" in capsys.readouterr().out
