"""Board-specific settings: crystal, configuration words, and devices on the pins."""

from __future__ import annotations

import pytest

from emu.boards import BOARDS, board_named
from emu.boards.epuck.board import Epuck
from emu.boards.part import BoardPart
from emu.chips import chip_named
from emu.image.loader import parse_image
from emu.image.model import Image
from emu.machine.machine import Machine
from emu.peripherals import Peripherals

LOOP_HEX = b":020000040000FA\n:04000000FFFF3700C7\n:00000001FF\n"
"""`bra` to itself at address 0."""
WATCHDOG_ON = 0xFFFF


class Bench(BoardPart):
    """Board with a slow crystal, an enabled watchdog and a lamp on RD0."""

    def __init__(self, chip: Peripherals) -> None:
        super().__init__("bench", chip)
        chip.configure(crystal=4_000_000, config={"FWDT": WATCHDOG_ON})
        self.lit = self.cell("lit")
        chip.pins.watch("RD0", self._edge, lazy=True)

    def _edge(self, _cycle: int, changed: int, levels: int) -> None:
        self.lit.value += bool(changed & levels)


def image() -> Image:
    """Return an image for the 30F4013 without configuration words."""
    return parse_image(LOOP_HEX, "loop.hex", chip_named("30F4013"))


def test_a_board_brings_its_crystal_and_its_configuration_words() -> None:
    """A board defines the crystal (XT with PLL 8 from 4 MHz gives 8 MIPS) and the configuration words that the image
    lacks."""
    machine = Machine(chip_named("30F4013"), engine="plain", board=Bench)
    machine.load(image())
    assert machine.hz == 8_000_000
    assert machine.program.setting("FWDT") == WATCHDOG_ON
    machine.write("TRISD", 0)
    for level in (1, 0, 1):
        machine.write("LATD", level)
        machine.run_until(machine.cycle + 4)
    machine.pins.flush()
    assert machine.board.lit.value == 2


def test_bare_pins_have_the_watchdog_off_and_nothing_of_a_robot() -> None:
    """Without a board the watchdog is off, all other configuration words are erased, and no robot device exists."""
    machine = Machine(chip_named("30F4013"), engine="plain")
    machine.load(image())
    assert machine.program.setting("FWDT") == 0x7FFF
    assert {machine.program.setting(name) for name in machine.chip.config} == {0x7FFF, 0xFFFF}


def test_an_epuck_refuses_another_chip() -> None:
    """The e-puck board refuses another chip, which lacks pins of its devices."""
    with pytest.raises(ValueError, match="an e-puck has a dsPIC30F6014A, not a dsPIC30F4013"):
        Machine(chip_named("30F4013"), engine="plain", board=Epuck)


def test_boards_are_found_by_name() -> None:
    """The command line and `emu.load` find boards by name."""
    assert [board_named(name) for name in BOARDS] == [Epuck, None]
    with pytest.raises(ValueError, match="expected one of epuck, none"):
        board_named("kilobot")
