"""A robot without a program: the test accesses registers at chosen cycles."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from emu.boards.epuck.board import Epuck
from emu.machine.machine import Machine
from toolchain.driver.driver import main as compile_program

PROGRAMS = Path(__file__).with_name("programs")


@pytest.fixture(scope="session")
def program(tmp_path_factory) -> Callable[..., Path]:
    """Return a function that builds programs: program("camera.c", "lines.s") returns the path of the ELF file."""
    folder = tmp_path_factory.mktemp("programs")

    @cache
    def build(*sources: str) -> Path:
        target = folder / (Path(sources[0]).stem + ".elf")
        paths = [str(PROGRAMS / source) for source in sources]
        assert compile_program(["-Os", "-fxc16-attributes", *paths, "-o", str(target)]) == 0
        return target

    return build


class Robot:
    """Test rig for a robot without a program. Only `at` advances time; all other methods act in the current cycle."""

    def __init__(self, **options) -> None:
        self.machine = Machine(engine="plain")
        self.board = Epuck(self.machine.peripherals, **options)
        self.events = self.machine.events

    def at(self, cycle: int) -> Robot:
        """Advance time so that the next access is in `cycle`."""
        assert cycle >= self.events.now
        self.events.arrive(cycle)
        self.events.settle(cycle)
        return self

    def later(self, cycles: int) -> Robot:
        return self.at(self.events.now + cycles)

    def read(self, name: str) -> int:
        return self.machine.bus.read(self.machine.chip.sfrs[name].address)

    def write(self, name: str, value: int) -> None:
        self.machine.bus.write(self.machine.chip.sfrs[name].address, value)

    def write_all(self, **values: int) -> None:
        """Write registers in this order, all in the current cycle."""
        for name, value in values.items():
            self.write(name, value)

    def output(self, pin: str, level: int) -> None:
        """Drive a port pin as a program does."""
        letter, mask = pin[1], 1 << int(pin[2:])
        tris, lat = self.read("TRIS" + letter), self.read("LAT" + letter)
        self.write("LAT" + letter, lat | mask if level else lat & ~mask)
        self.write("TRIS" + letter, tris & ~mask)

    def configure(self, registers) -> None:
        """Write camera registers as the I2C bus does: (bank, register, value)."""
        camera = self.board.camera
        for bank, register, value in registers:
            for number, byte in ((camera.sensor.bank_register, bank), (register, value)):
                if number is not None:
                    assert camera.start(False, self.events.now)
                    camera.write(number, self.events.now)
                    camera.write(byte, self.events.now)


@pytest.fixture
def robot() -> Robot:
    return Robot()
