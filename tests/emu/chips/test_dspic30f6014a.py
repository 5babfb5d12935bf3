"""Consistency of the tables of the dsPIC30F6014A."""

from __future__ import annotations

import pytest

from emu.chips.dspic30f6014a import CONFIG, DSPIC30F6014A, INTERRUPTS, SFRS, VECTORS
from emu.peripherals.pins import parse_pin


def test_register_words_do_not_overlap():
    """No two 16-bit registers share an even address."""
    addresses = [sfr.address for sfr in SFRS.values() if sfr.size == 2]
    assert len(addresses) == len(set(addresses))
    assert all(address % 2 == 0 for address in addresses)


def test_fields_lie_inside_the_mask_and_apart():
    """The `fields` of a register are implemented bits, and no bit is in two fields."""
    for sfr in SFRS.values():
        seen = 0
        for name, (lsb, width) in sfr.fields.items():
            bits = ((1 << width) - 1) << lsb
            assert not bits & ~sfr.mask, (sfr.name, name)
            assert not bits & seen, (sfr.name, name)
            seen |= bits


def test_reset_values_have_no_unimplemented_bits():
    """Reset values have only implemented bits, except XMODEND and YMODEND, whose bit 0 always reads 1."""
    assert [sfr.name for sfr in SFRS.values() if sfr.reset & ~sfr.mask] == []


@pytest.mark.parametrize(
    ("slot", "name", "ivt", "aivt"),
    [
        (1, "OscillatorFail", 0x06, 0x86), (4, "MathError", 0x0C, 0x8C), (8, "INT0Interrupt", 0x14, 0x94),
        (19, "ADCInterrupt", 0x2A, 0xAA), (29, "T4Interrupt", 0x3E, 0xBE), (49, "DCIInterrupt", 0x66, 0xE6),
        (61, "Interrupt53", 0x7E, 0xFE),
    ],
)  # fmt: skip
def test_vectors_sit_where_the_table_says(slot, name, ivt, aivt):
    """dspic30f6014a.md §5.1, §5.2; abi-elf.md §2.7: vectors are at the addresses of the reference."""
    vector = VECTORS[slot]
    assert (vector.name, vector.ivt, vector.aivt, vector.symbol) == (name, ivt, aivt, "__" + name)


def test_there_are_62_vectors_and_41_interrupt_sources():
    """dspic30f6014a.md §5.2: there are 62 vectors and 41 interrupt sources; the reference names 45 sources, four of
    them only on motor parts."""
    assert len(VECTORS) == 62
    assert len(INTERRUPTS) == 41
    assert [v.name for v in VECTORS if v.irq is not None and v.irq < 45 and not v.implemented] == [
        "PWMInterrupt",
        "QEIInterrupt",
        "FLTAInterrupt",
        "FLTBInterrupt",
    ]


def test_every_site_names_real_pins_and_real_sources():
    """Every pin of a device exists in a TRIS mask, and every interrupt number is implemented."""
    chip = DSPIC30F6014A
    sites = [*chip.timers, *chip.uarts, *chip.spis, chip.i2c, *chip.captures, *chip.compares, chip.dci, *chip.cans]
    for site in sites:
        for field in site.__slots__:
            value = getattr(site, field)
            if field.endswith("_pin") or field == "pin":
                port, mask = parse_pin(value)
                assert SFRS["TRIS" + "ABCDEFG"[port]].mask & mask, value
            elif field.endswith("irq"):
                assert value in INTERRUPTS, (site, field)


def test_configuration_fields_are_cut_from_stored_words():
    """dspic30f6014a.md §2: fields are extracted from stored configuration words, such as the e-puck's FOSC 0xFFE6."""
    fosc = CONFIG["FOSC"]
    assert [fosc.field(0xFFE6, name) for name in ("FCKSM", "FOS", "FPR")] == [3, 7, 6]
