"""The chip of an image: members of the family by processor id, and HEX files that fit no chip."""

from __future__ import annotations

import re

import pytest

from emu.chips import NAMES, chip_named, chip_of
from emu.chips.members import MEMBERS, nearest
from emu.image.loader import parse_image
from emu.image.model import LoadError
from emu.machine.machine import Machine
from tests.emu.loader.elf_samples import ElfSample, SampleSection, words


def small_elf(processor: int) -> bytes:
    """Return an ELF file of one instruction for a processor id."""
    sample = ElfSample([SampleSection(".text", 0x100, words(0x37FFFF))])
    sample.flags = processor
    return sample.build()


def hex_file(**words: int) -> bytes:
    """Return a HEX file with words at the addresses `a<hex>`."""
    lines = []
    for name, word in sorted(words.items(), key=lambda item: int(item[0][1:], 16)):
        place = int(name[1:], 16) * 2
        for record in ((2, 0, 4, place >> 24, place >> 16 & 0xFF),
                       (4, place & 0xFFFF, 0, *word.to_bytes(4, "little"))):  # fmt: skip
            octets = bytes((record[0], record[1] >> 8, record[1] & 0xFF, *record[2:]))
            lines.append(":" + (octets + bytes((-sum(octets) & 0xFF,))).hex().upper())
    return ("\n".join([*lines, ":00000001FF"]) + "\n").encode()


def test_every_member_is_modelled_or_has_a_nearest_chip() -> None:
    for processor, member in MEMBERS.items():
        chip = chip_of(processor)
        assert chip is not None if member in NAMES else nearest(member) in NAMES
        assert chip is None or chip.name == member


@pytest.mark.parametrize("processor", [number for number, member in MEMBERS.items() if member in NAMES])
def test_an_image_of_a_modelled_member_is_loaded_for_it(processor: int) -> None:
    image = parse_image(small_elf(processor), "a.elf")
    assert (image.chip.name, image.warnings) == (MEMBERS[processor], ())


def test_an_image_of_another_member_is_refused_by_name() -> None:
    """The message names the member and the chip to use instead; with that chip the file is loaded with a warning."""
    with pytest.raises(LoadError, match=r"a\.elf: is built for the dsPIC30F3013, .*`--chip 30F3014`"):
        parse_image(small_elf(0x0C), "a.elf")
    image = parse_image(small_elf(0x0C), "a.elf", chip_named("30F3014"))
    assert image.warnings == ("built for the dsPIC30F3013, not for the dsPIC30F3014 (0xd); loaded for that",)


@pytest.mark.parametrize(
    ("chip", "fosc", "fcy"),
    [
        ("30F6014A", 0xFFE6, 14_745_600),  # XT with PLL x8
        ("30F6014", 0xFFF6, 14_745_600),  # the same mode, in the codes of the part without A
        ("30F6014A", 0xFFF6, 14_745_600 / 3),  # the A part reads it as HS/3 with PLL x8
        ("30F6014", 0xFFF4, 1_843_200),  # XT without PLL
        ("30F4011", 0xFFF7, 29_491_200),  # XT with PLL x16
        ("30F4011", 0xFFFA, 7_370_000 * 2),  # FRC with PLL x8
        ("30F4011", 0xFDFF, 7_370_000 / 4),  # FRC
        ("30F3014", 0xFFE5, 7_372_800),  # XT with PLL x4
    ],
)
def test_the_chip_decodes_its_configuration_word(chip: str, fosc: int, fcy: float) -> None:
    """The codes of FOSC differ between the parts with FOS in two bits and those with FOS in three."""
    machine = Machine(chip_named(chip), engine="plain")
    machine.program.put(0xF80000, fosc)
    machine.reset("POR")
    assert float(machine.hz) == pytest.approx(fcy, rel=1e-12)
    locked = bool(machine.peek("OSCCON") & 0x20)
    assert locked == (fosc not in (0xFFF4, 0xFDFF))


def test_the_tuning_of_the_internal_oscillator_is_in_osccon() -> None:
    """Parts without OSCTUN have TUN3:0 in OSCCON<15:14,11:10>; a new value changes the clock."""
    machine = Machine(chip_named("30F4011"), engine="plain")
    machine.program.put(0xF80000, 0xFDFF)
    machine.reset("POR")
    before = machine.hz
    for place, octet in ((0x743, 0x78), (0x743, 0x9A), (0x743, 0x15)):  # NOSC = COSC = FRC, TUN0 = 1
        machine.events.arrive(machine.events.now + 1)
        machine.bus.write(place & ~1, octet << 8, 0xFF00)
    assert machine.hz > before


def test_a_hex_file_that_fits_says_nothing() -> None:
    image = parse_image(hex_file(a0=0x040100, a2=0, a4=0x100, a100=0x37FFFF, aF80000=0xC706), "a.hex")
    assert image.warnings == ()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"a0": 0x040200}, "reset vector jumps to 0x000200, where the file has no code"),
        ({"a4": 0x2000, "a100": 0}, r"vectors point to addresses without code: ReservedTrap0 \(0x002000\)"),
        ({"aF80000": 0xC306}, "FOSC = 0xc306 selects no clock mode of the dsPIC30F6014A"),
    ],
)
def test_a_hex_file_that_does_not_fit_says_so(words: dict[str, int], said: str) -> None:
    """A HEX file does not name its chip; vectors and configuration words show that it is for another one."""
    image = parse_image(hex_file(**words), "a.hex")
    assert len(image.warnings) == 1
    assert re.search(said, image.warnings[0])


def test_a_configuration_word_that_the_chip_lacks_is_named() -> None:
    """FBS exists on parts with CodeGuard only."""
    image = parse_image(hex_file(a100=0, aF80006=0x000E), "a.hex", chip_named("30F4013"))
    assert image.warnings == ("configuration word 0x000e at 0xf80006: the dsPIC30F4013 has none there",)
