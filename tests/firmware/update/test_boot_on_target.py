"""The boot loader `firmware/apps/boot` on an emulated robot accepts programs of `openswarm flash` and preserves
itself."""

from __future__ import annotations

import os
import pty
import select
import threading
import tty

import pytest

import emu
from emu.image.loader import load_image
from emu.image.model import Image
from emu.machine.machine import Machine
from openswarm.cli import main
from openswarm.flashing.boot_session import BootSession
from openswarm.flashing.loaders import LOADERS, ROW_UNITS, block
from openswarm.flashing.rows import goto, rows
from tests.firmware.bluetooth_connection import SLICE, Line
from tests.json_schemas import validated

LOADER = LOADERS[0x91]
PROGRAM = """
#include <p30F6014A.h>
int main(void)
{
    static const char text[] = "it runs\\n";
    U1BRG = 7;
    U1MODE = 0x8000;
    U1STA = 0x0400;
    for (const char *c = text;; c = c[1] ? c + 1 : text) {
        while (U1STAbits.UTXBF) {
        }
        U1TXREG = *c;
    }
}
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Image:
    folder = tmp_path_factory.mktemp("flashed")
    (folder / "main.c").write_text(PROGRAM)
    return load_image(emu.build(folder / "main.c", output=folder / "main.elf"))


@pytest.fixture
def robot(image) -> Machine:
    """Return a robot that contains only the boot loader."""
    return emu.load(image("boot"))


def loader_rows(machine: Machine) -> list[int]:
    return [machine.program.word(address) for address in range(LOADER.start, 0x18000, 2)]


def test_it_lies_where_the_host_knows_it(image):
    """The boot loader occupies rows up to the end of flash, and the reset instruction jumps to it."""
    loader = load_image(image("boot"))
    assert [loader.word(0), loader.word(2)] == goto(LOADER.start)
    assert all(address < 0x100 or address >= LOADER.start for address, _ in loader.words(loader.chip.program["flash"]))
    assert LOADER.start % ROW_UNITS == 0


@pytest.mark.slow
def test_damage_and_a_cut_in_the_middle_leave_a_robot_that_can_be_reached(robot, program):
    """A wrong checksum is refused before anything is erased; an interrupted transfer leaves the robot reachable.

    The robot then waits for the host after every reset until all rows are written. Its own rows never change.
    """
    own = loader_rows(robot)
    line = Line(robot)
    talk = BootSession(line, 2.0)
    wanted = rows(program, talk.loader)
    assert talk.loader == LOADER
    before = robot.program.word(0x100)
    spoiled = bytearray(block(*wanted[2]))
    spoiled[40] ^= 0x10
    line.write(bytes(spoiled))
    assert line.read(1.0) == b"N"
    assert robot.program.word(0x100) == before
    for address in (LOADER.start, 0x17FC0, 0x018000, 0x7FF000, 0x000020):
        line.write(block(address, [0] * 32))
        assert line.read(1.0) == b"N", hex(address)
    line.write(block(0, [0] * 32))
    assert line.read(1.0) == b"N"  # word 0 must jump to the loader

    talk.write(wanted[:4], lambda done, total: None)
    line.write(block(*wanted[4])[:50])
    robot.run(seconds=0.01)
    robot.reset()
    again = BootSession(line, 1.0)  # later than the time-out: without a program the loader continues to wait
    again.write(wanted, lambda done, total: None)
    again.start()
    robot.run(seconds=0.02)
    assert b"it runs\nit runs\n" in line.heard
    assert loader_rows(robot) == own
    line.discard_received()
    robot.reset()
    robot.run(seconds=1.02)
    assert b"it runs\nit runs\n" in line.heard  # after one second without a greeting from a host


@pytest.mark.slow
def test_the_command_flashes_a_robot_behind_a_pseudo_terminal(robot, program, capsys):
    """`openswarm flash` writes a program through a pseudo terminal, and the program prints on the same port."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    said = bytearray()
    robot.board.bluetooth.on_byte = lambda byte, _cycle: (said.append(byte), os.write(master, bytes([byte])))
    words = ["flash", program.path, "--port", os.ttyname(slave), "--wait", "60", "--json"]
    status: list[int] = []
    host = threading.Thread(target=lambda: status.append(main(words)))
    host.start()
    try:
        while host.is_alive():
            if select.select([master], [], [], 0)[0]:
                robot.board.bluetooth.feed(os.read(master, 4096))
            robot.run(cycles=SLICE)
        while select.select([master], [], [], 0)[0]:
            robot.board.bluetooth.feed(os.read(master, 4096))
        said.clear()
        robot.run(seconds=0.02)
    finally:
        host.join()
        os.close(master)
        os.close(slave)
    assert status == [0]
    facts = validated("openswarm", "flash", capsys.readouterr().out)
    assert (facts["loader"]["name"], facts["rows"]) == ("OpenSwarm's", len(rows(program, LOADER)))
    assert b"it runs\nit runs\n" in said
