"""A program's EEPROM write that a reset interrupts (dspic30f6014a.md §16)."""

from __future__ import annotations

import pytest

from emu.api import Machine
from emu.boards.epuck.board import Epuck
from emu.image.loader import load_image

LAST_WORD = 0x7FFFFE
BUSY_TCY = 29_491
"""Duration of an erase or a program operation in Tcy: 2 ms."""


@pytest.fixture(params=["plain", "auto"])
def machine(request, program) -> Machine:
    image = load_image(program("eeprom.c"))
    made = Machine(image.chip, engine=request.param, board=Epuck)
    made.load(image)
    return made


def run_until_led(machine: Machine, pin: str) -> None:
    for _ in range(1000):
        machine.run(cycles=100)
        if machine.pins.get(pin):
            return
    raise AssertionError(f"{pin} never rose")


def test_an_undisturbed_write_takes_two_times_two_milliseconds(machine):
    """§16: erase and program take 2 ms each; meanwhile the CPU runs and reads WR = 1."""
    machine.run(cycles=2 * BUSY_TCY + 2_000)
    assert machine.peek("done") == machine.program.word(LAST_WORD) == 1
    assert (machine.peek("found"), machine.peek("errors")) == (0xFFFF, 0)
    machine.reset("EXTR")
    machine.run(cycles=2 * BUSY_TCY + 2_000)
    assert (machine.peek("found"), machine.peek("done"), machine.peek("errors")) == (1, 2, 0)


@pytest.mark.parametrize(("pin", "left"), [("RA6", 0xFFFF), ("RA7", 0xFFFF)])
@pytest.mark.parametrize("cause", ["EXTR", "WDTO"])
def test_a_reset_during_a_write_sets_wrerr_and_the_next_write_works(machine, pin, left, cause):
    """§16: a reset during an operation sets WRERR. The word then reads as erased, the program starts again, and its
    next write works."""
    machine.program.put(LAST_WORD, 7)
    run_until_led(machine, pin)
    machine.run(cycles=BUSY_TCY // 2)
    machine.reset(cause)
    assert machine.program.word(LAST_WORD) == left
    machine.run(cycles=1_000)
    assert (machine.peek("errors"), machine.peek("found")) == (1, left)
    machine.run(cycles=2 * BUSY_TCY + 2_000)
    assert machine.peek("done") == machine.program.word(LAST_WORD) == 1
    assert machine.peek("NVMCON") & 0x8000 == 0
