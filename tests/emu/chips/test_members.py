"""Every supported chip has consistent tables, and a machine with it can be constructed."""

from __future__ import annotations

import pytest

from emu.chips import NAMES, chip_named, chip_of
from emu.chips.chip import Chip
from emu.machine.machine import Machine
from emu.peripherals.pins import parse_pin

CHIPS = [chip_named(name) for name in NAMES]


def pins_of(chip: Chip) -> set[str]:
    """Return every pin in the tables."""
    sites = (*chip.uarts, *chip.spis, *chip.captures, *chip.compares, *chip.cans, chip.i2c, chip.dci)
    named = {getattr(site, field) for site in sites if site is not None
             for field in site.__dataclass_fields__ if field.endswith("pin")}  # fmt: skip
    named |= {*chip.change_pins, *(pin for pin, _ in chip.external_pins), *chip.adc.pins}
    return (named | {timer.clock_pin for timer in chip.timers}) - {""}


@pytest.mark.parametrize("chip", CHIPS, ids=NAMES)
def test_registers_do_not_overlap_and_fields_lie_in_their_masks(chip: Chip) -> None:
    """Registers do not overlap, byte rows name halves of words, and fields are implemented bits."""
    words = [sfr.address for sfr in chip.sfrs.values() if sfr.size == 2]
    assert len(set(words)) == len(words)
    for sfr in chip.sfrs.values():
        assert sfr.address in chip.data["sfr"]
        covered = 0
        for lsb, width in sfr.fields.values():
            covered |= (1 << width) - 1 << lsb
        assert not covered & ~sfr.mask, sfr.name
        assert not (sfr.reset | sfr.hw_owned | sfr.clear_only) & ~sfr.mask, sfr.name


@pytest.mark.parametrize("chip", CHIPS, ids=NAMES)
def test_pins_exist(chip: Chip) -> None:
    """Every pin that a device uses is a bit of a port."""
    for pin in pins_of(chip):
        _port, mask = parse_pin(pin)
        assert mask & chip.sfrs[f"PORT{pin[1]}"].mask, pin
        assert pin[1] in chip.ports


@pytest.mark.parametrize("chip", CHIPS, ids=NAMES)
def test_every_interrupt_has_flag_enable_and_priority(chip: Chip) -> None:
    """Flag, enable bit and priority of every interrupt are fields of registers; the priority has three bits."""
    for source in chip.interrupts.values():
        stem = "AD" if source.name == "ADC" else source.name
        places = ((source.flag, "IF", 1), (source.enable, "IE", 1), (source.priority, "IP", 3))
        for (register, bit), suffix, width in places:
            assert chip.sfrs[register].fields[stem + suffix] == (bit, width)
        assert chip.vectors[source.irq + 8].implemented


@pytest.mark.parametrize("chip", CHIPS, ids=NAMES)
def test_a_program_runs_in_every_engine(chip: Chip) -> None:
    """A program at the end of flash, interrupted by timer 1, reaches the same state in the same cycle in every
    engine."""
    states = []
    for engine in ("plain", "jit"):
        machine = Machine(chip, engine=engine)
        machine.program.put(chip.config["FWDT"].address, 0x7FFF)
        machine.reset("POR")
        end = chip.program["flash"].end
        for address, word in ((0, 0x040000 | end - 16), (2, 0), (end - 16, 0x37FFFF), (chip.vectors[11].ivt, end - 8),
                              (end - 8, 0xEC2000 | 0x900), (end - 6, 0xA96084), (end - 4, 0x064000)):  # fmt: skip
            machine.program.put(address, word)
        machine.program.put(2, end - 16 >> 16)
        machine.program.put(0, 0x040000 | end - 16 & 0xFFFF)
        machine.write("PR1", 40)
        machine.write("IEC0", 8)
        machine.write("T1CON", 0x8000)
        machine.run_until(1000)
        assert machine.peek(0x900) > 10
        states.append(machine.snapshot())
    assert states[0] == states[1]


def test_the_30f4013_has_the_processor_id_that_xc16_writes() -> None:
    """Public XC16 files for the 30F4013 carry 0x0E. The assembler and the linker write the first id of a chip."""
    found = chip_of(0x0E)
    assert found is not None
    assert (found.name, found.processors[0]) == ("dsPIC30F4013", 0x0E)


def test_chips_are_found_by_name_and_by_processor_id() -> None:
    """Chips are found by the names that command lines use and by the processor ids in the flags of ELF files."""
    for chip in CHIPS:
        short = chip.name.removeprefix("dsPIC")
        assert chip_named(short).name == chip_named(short.lower()).name == chip.name
        assert all(found is not None and found.name == chip.name for found in map(chip_of, chip.processors))
    assert chip_of(0xFFFF) is None
    with pytest.raises(ValueError, match="expected one of dsPIC30F6014A"):
        chip_named("PIC16F84")
