"""AVR images: ELF and Intel HEX load to the same flash; damaged files give one clear error."""

from __future__ import annotations

import random
import subprocess
from pathlib import Path

import pytest

from emu.avr.image import load_avr_image, parse_avr_image
from emu.image.model import LoadError
from tests.emu.avr.conftest import Build, needs
from tests.fuzz.seeds import base_seed

PROGRAM = """
#include <avr/eeprom.h>
uint8_t EEMEM stored = 0x42;
volatile uint16_t counter = 0x1234;
int main(void) { counter++; for (;;) ; }
"""


def test_elf_and_hex_are_the_same(build: Build, tmp_path: Path) -> None:
    """The HEX file of an ELF file gives the same flash; the ELF file has symbols, lines and EEPROM."""
    image = build(PROGRAM)
    out = tmp_path / "program.hex"
    subprocess.run(["avr-objcopy", "-O", "ihex", "-R", ".eeprom", image.path, str(out)], check=True)
    hexed = load_avr_image(str(out))
    assert hexed.flash == image.flash
    assert hexed.flash_used == image.flash_used
    counter, main = image.symbols.find("counter"), image.symbols.find("main")
    assert counter is not None
    assert main is not None
    assert (counter.space, counter.address >= 0x100) == ("data", True)
    assert "program.c" in image.place(main.address)
    assert list(image.eeprom.values()) == [0x42]
    assert hexed.place(main.address) == f"{main.address:#06x}"


def test_refusals(tmp_path: Path) -> None:
    """Each unusable file gets one line that says what it is and what was expected."""
    elf = b"\x7fELF\x01\x01\x01" + bytes(9)
    for data, text in (
        (b"", "is empty"),
        (b"\x00\x01", "is neither ELF nor Intel HEX"),
        (b":00000001FF\n", "defines no byte of flash"),
        (b":0100000000FF\n", "is truncated: no end-of-file record"),
        (b":0100000000FE\n:00000001FF\n", "line 1: checksum is FE"),
        (b":020000040001F9\n:0100000000FF\n:00000001FF\n", "line 2: bytes at 0x10000 are outside"),
        (elf + b"\x02\x00\x03\x00" + bytes(32), "is an ELF file for EM_386"),
        (elf, "is damaged"),
    ):
        with pytest.raises(LoadError, match=text):
            parse_avr_image(data, "file")
    with pytest.raises(LoadError, match="is a directory"):
        load_avr_image(str(tmp_path))
    with pytest.raises(LoadError, match="cannot be read"):
        load_avr_image(str(tmp_path / "none.elf"))


def test_fuses_and_eeprom_in_a_hex_file() -> None:
    """avr-objcopy writes EEPROM at 0x810000 and fuses from 0x820000: the first is loaded, the others are ignored."""
    records = """
        :02000004008179
        :010001009A64
        :02000004008278
        :03000000E2D9FF43
        :020000040000FA
        :02000000FFCF30
        :00000001FF
        """
    image = parse_avr_image(records.encode("ascii"), "fuses.hex")
    assert image.eeprom == {1: 0x9A}
    assert image.flash_used == 2


def test_other_microcontrollers_are_refused(tmp_path: Path) -> None:
    """A file for another AVR names it; the ATmega328 and the ATmega168 have the same registers and vectors."""
    needs("avr-gcc")
    source = tmp_path / "p.c"
    source.write_text("int main(void) { for (;;) ; }\n")
    for device, text in (("atmega644", "is built for the atmega644"), ("attiny85", "is built for the attiny85"),
                         ("avr4", "architecture avr4, not avr5"), ("atmega328", ""), ("atmega168p", "")):  # fmt: skip
        out = tmp_path / f"{device}.elf"
        start = ["-nostdlib", "-Wl,--entry=main"] if device.startswith("avr") else []
        subprocess.run(["avr-gcc", f"-mmcu={device}", *start, str(source), "-o", str(out)], check=True)
        if text:
            with pytest.raises(LoadError, match=text):
                load_avr_image(str(out))
        else:
            assert load_avr_image(str(out)).flash_used > 100


def test_damaged_files_are_refused(build: Build) -> None:
    """Random damage to an ELF file gives an image or a LoadError, never another exception."""
    data = Path(build(PROGRAM).path).read_bytes()
    dice = random.Random(base_seed())
    for _ in range(60):
        damaged = bytearray(data)
        for _ in range(dice.randint(1, 8)):
            damaged[dice.randrange(dice.choice((64, 400, len(damaged))))] = dice.randrange(256)
        try:
            image = parse_avr_image(bytes(damaged[: dice.choice((len(damaged), dice.randrange(len(damaged))))]), "file")
            image.place(0x80)
        except LoadError:
            pass
