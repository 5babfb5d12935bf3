"""Programs for the update slot: `openswarm program` builds them, and independently built firmware runs them.

Programs that cannot run in the slot are refused.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import emu
from emu.host.exit_status import BAD_INPUT, FAULT
from emu.image.loader import load_image
from openswarm.cli import main
from openswarm.flashing.program import RAM, SLOT, is_program, program_of
from tests.json_schemas import validated

TARGET_APPS = Path(__file__).parents[1] / "target"
UPDATE = Path(__file__).parents[3] / "firmware" / "openswarm" / "board" / "epuck" / "update"
CALLS = 0x00F780
TRIES = 3
LAMP = "#include <openswarm_io.h>\nint main(void) { return Sys_Set_LED(SYS_LED_BODY, true); }\n"


@pytest.mark.slow
def test_a_program_of_all_that_c_has_runs_in_the_slot(image):
    """A program in the slot uses constants, variables, the library, a handler and a thread through the kernel's call
    table."""
    machine = emu.load(image("programs", TARGET_APPS))
    said = bytearray()
    machine.board.bluetooth.on_byte = lambda byte, _cycle: said.append(byte)
    machine.run(seconds=0.35)
    assert machine.peek("started") == 7
    numbers = ("zero", "one", "two")
    lines = [f"{numbers[n % 3]} {3 * (n - 1)} {1_000_000 + 7 * n} {n * n if n % 2 else 2 * n}" for n in range(1, 6)]
    assert said.decode().splitlines()[:6] == ["talks", *lines]


@pytest.mark.slow
def test_firmware_that_offers_fewer_calls_is_left_in_peace(image):
    """A program with unknown kernel calls resets the robot; after three starts the firmware runs without it."""
    machine = emu.load(image("programs", TARGET_APPS))
    machine.program.put(CALLS, machine.program.word(CALLS) - 1)
    said = bytearray()
    machine.board.bluetooth.on_byte = lambda byte, _cycle: said.append(byte)
    machine.run(seconds=1.0)
    assert machine.peek("started") == 0
    assert [cause for _, cause in machine.resets if cause != "POR"] == ["SWR"] * TRIES
    assert not said


def built(folder: Path, text: str, *words: str) -> tuple[int, Path]:
    (folder / "main.c").write_text(text)
    out = folder / "made.elf"
    return main(["program", str(folder / "main.c"), "--version", "3", "-o", str(out), *words]), out


def test_the_command_tells_what_it_has_made(tmp_path, capsys):
    status, out = built(tmp_path, LAMP, "--json", "--header", str(tmp_path / "my-lamp.h"))
    assert status == 0
    facts = validated("openswarm", "program", capsys.readouterr().out)
    program = program_of(load_image(str(out)))
    assert facts == {"program": str(out), "version": 3, "rows": 1, "crc": program.crc, "ram": 0}
    text = (tmp_path / "my-lamp.h").read_text()
    assert "static const uint8 my_lamp[][96] = {" in text
    assert bytes(int(byte, 16) for byte in re.findall(r"0x(..)", text)) == program.rows[0]
    assert is_program(load_image(str(out)))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("volatile char much[600]; int main(void) { return much[599]; }", "overflows by"),
        ("int main(void) { __asm__ volatile(\".rept 1100\\n nop\\n .endr\"); return 0; }", "overflows by"),
        ("void Sys_Init_Kernel(void);\nint main(void) { Sys_Init_Kernel(); }", "undefined symbol _Sys_Init_Kernel"),
        ("void __attribute__((interrupt)) _T1Interrupt(void) {}\nint main(void) {}", "handler of interrupts"),
        ("int start(void) { return 0; }", "undefined symbol _main"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_told_and_leaves_no_file(tmp_path, capsys, text, message):
    status, out = built(tmp_path, text)
    assert status == BAD_INPUT
    assert message in capsys.readouterr().err
    assert not out.exists()


def test_errors_of_c_are_status_1(tmp_path):
    assert built(tmp_path, "int main(void) { return x; }")[0] == FAULT


@pytest.mark.parametrize("version", ["0", "65536", "-1", "1.0", "x", ""])
def test_versions_are_numbers_that_robots_know(version):
    with pytest.raises(SystemExit):
        main(["program", "main.c", f"--version={version}"])


def test_the_version_is_not_written_where_it_would_be_lost(capsys):
    assert main(["program", "main.c", "--version", "1", "-o", "made.hex"]) == BAD_INPUT
    assert "made.hex: the version would be lost" in capsys.readouterr().err


@pytest.mark.slow
def test_other_images_are_no_programs(image):
    firmware = load_image(image("programs", TARGET_APPS))
    assert not is_program(firmware)
    with pytest.raises(
        ValueError, match=r"has no __update_version: expected the ELF file that `openswarm program` made"
    ):
        program_of(firmware)


def test_the_host_and_the_firmware_know_one_slot():
    """update_slots.h (for C and assembly) and program.py (for Python) define the same slot."""
    text = (UPDATE / "update_slots.h").read_text()
    known = {name: int(value, 0) for name, value in re.findall(r"#define (\w+) (0x[0-9A-F]+|\d+)\n", text)}
    assert (known["UPDATE_RUN"], known["UPDATE_RUN_END"], known["UPDATE_CALLS"]) == (SLOT.start, SLOT.end, CALLS)
    assert (known["UPDATE_RAM"], known["UPDATE_RAM_BYTES"]) == (RAM.start, RAM.size)
