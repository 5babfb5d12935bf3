"""Every register has a model, or is in the list of plain registers with a reason."""

from __future__ import annotations

from pathlib import Path

from emu.machine.machine import Machine
from emu.peripherals.system.plain_registers import PLAIN, report

LIST = Path(__file__).parents[3] / "docs" / "plain-registers.md"


def test_every_register_is_modelled_or_listed_as_plain():
    """Every register is claimed on the bus by the CPU or a device, or is listed as plain."""
    machine = Machine(engine="plain")
    unclaimed = {
        sfr.name
        for sfr in machine.chip.sfrs.values()
        if sfr.size == 2 and not machine.bus.modelled[sfr.address >> 1] and not sfr.name.startswith("WREG")
    }
    assert unclaimed <= set(PLAIN)


def test_plain_registers_are_reported_once_and_store_their_bits():
    """A register without a model stores its implemented bits, and its first access is reported once."""
    machine = Machine(engine="plain")
    seen = []
    machine.bus.report = lambda address, is_write: seen.append((machine.bus.name[address >> 1], is_write))
    machine.write("BSRAM", 0xFFFF)
    assert machine.read("BSRAM") == 0x0007
    assert seen == [("BSRAM", True)]


def test_printed_list_is_up_to_date():
    """docs/plain-registers.md equals the report that the code generates."""
    machine = Machine(engine="plain")
    assert LIST.read_text() == report(machine.chip, machine.bus)
