"""`openswarm flash` transfers a program over Bluetooth to a robot that runs `apps/spreading`."""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from pathlib import Path

import pytest

import emu
from emu.image.loader import load_image
from emu.machine.machine import Machine
from openswarm.cli import main
from openswarm.flashing.authentication import authenticated, key_row
from openswarm.flashing.boot_session import RobotError
from openswarm.flashing.loaders import LOADERS
from openswarm.flashing.messages import Advertisement, framed, unframed
from openswarm.flashing.program import SLOT, Program, program_of
from openswarm.flashing.rows import rows
from openswarm.flashing.spreading import HostNeighbour
from tests.firmware.bluetooth_connection import SLICE, Line
from tests.json_schemas import validated

ROWS = 3


def built(folder: Path, version: int, filling: int = 1) -> Path:
    """Return a program of three rows that switches the body LED on."""
    source = folder / f"{version}-{filling}.c"
    words = ", ".join(str(filling * n) for n in range(1, 41))
    source.write_text(f"""
#include <openswarm_io.h>
static const uint16 filling[] = {{{words}}};
int main(void)
{{
    uint16 sum = 0;
    for (volatile uint16 n = 0; n < 40; n++) {{
        sum += filling[n];
    }}
    return Sys_Set_LED(SYS_LED_BODY, sum == {820 * filling});
}}
""")
    out = source.with_suffix(".elf")
    assert main(["program", str(source), "--version", str(version), "-o", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    folder = tmp_path_factory.mktemp("programs")
    return {version: built(folder, version) for version in (4, 5)}


@pytest.fixture
def robot(image) -> Machine:
    """Return a robot without a program and without neighbours."""
    return emu.load(image("spreading"))


def of(path: Path) -> Program:
    return program_of(load_image(str(path)))


def slot(machine: Machine, count: int) -> bytes:
    words = [machine.program.word(address) for address in range(SLOT.start, SLOT.start + 64 * count, 2)]
    return b"".join(word.to_bytes(3, "little") for word in words)


def run_until_stored(robot: Machine, program: Program) -> None:
    """Run until the slot holds the program, at most 4 s."""
    stored, end = b"".join(program.rows), robot.cycle + 4 * emu.FCY_HZ
    while slot(robot, len(program.rows)) != stored:
        assert robot.cycle < end
        robot.run(seconds=0.1)
    robot.run(seconds=0.3)


@pytest.mark.slow
def test_a_robot_takes_checks_and_runs_what_the_host_has(robot, programs):
    """A robot receives, checks and runs the host's program although parts are damaged on the way.

    A newer program replaces it; an older one, or another of the same version, is refused.
    """
    line, program = Line(robot), of(programs[4])
    assert len(program.rows) == ROWS
    write, sent = line.write, 0

    def damage(data: bytes) -> None:
        nonlocal sent
        sent += 1
        write(data if sent % 7 else data[:4] + bytes([data[4] ^ 0x40]) + data[5:])

    line.write = damage  # type: ignore[method-assign]
    host = HostNeighbour(line, program, 20.0)
    received: list[int] = []
    assert host.send(lambda done, total: received.append(done)) is False
    assert received == sorted(received)
    assert {0, 1, 2, 3} == set(received)
    assert host.counts.requests > ROWS
    host.activate()
    run_until_stored(robot, program)
    line.discard_received()
    assert HostNeighbour(line, program, 20.0).send(lambda done, total: None) is True  # the robot already has it
    newer = HostNeighbour(line, of(programs[5]), 20.0)
    assert newer.send(lambda done, total: None) is False
    with pytest.raises(RobotError, match=r"the robot has version 5 and accepts only a higher one: .* --version 6"):
        HostNeighbour(line, program, 20.0).send(lambda done, total: None)
    other = Program(5, program.rows[:2])
    with pytest.raises(RobotError, match="the robot has another program of version 5"):
        HostNeighbour(line, other, 20.0).send(lambda done, total: None)


@pytest.mark.slow
def test_a_robot_that_falls_silent_is_reported(robot, programs):
    """The host reports a robot that does not answer, and one that receives nothing after it has requested rows.

    First no message of the host arrives; then the robot is cut off as soon as it requests rows.
    """
    line, program = Line(robot), of(programs[4])
    write = line.write
    line.write = lambda data: None  # type: ignore[method-assign]
    with pytest.raises(RobotError, match=r"no robot answered within 3 s|the robot has version 0 and does not ask"):
        HostNeighbour(line, program, 3.0).send(lambda done, total: None)
    line.write = lambda data: write(data)  # type: ignore[method-assign]

    def cut(done: int, total: int) -> None:
        robot.board.bluetooth.on_byte = lambda byte, _cycle: None

    with pytest.raises(RobotError, match=r"the robot fell silent at row 0: it keeps the rows that it has"):
        HostNeighbour(line, program, 5.0).send(cut)


class Attacker(HostNeighbour):
    """A host that does not give up when the robot has a higher version."""

    def _check(self, said: Advertisement) -> None:
        self._own = said.version


@pytest.mark.slow
def test_a_robot_with_a_key_takes_only_programs_of_its_key(image, programs):
    """A robot that authenticates programs refuses those without its tag, and an authentic lower version.

    A host without the key is not asked for any row. From one that has it, forged programs arrive whole, with right
    CRCs: one without a tag, and one that has lost its first rows and kept the tag. Without the key, an authentic
    program that is stored is not activated.
    """
    key = bytes(range(1, 17))
    path = image("spreading", None, "DEVICES=infrared update update_auth")
    firmware, robot = load_image(str(path)), emu.load(path)
    row = key_row(firmware, key)
    written = rows(firmware, LOADERS[0x91], [row])
    assert row == written[-2]
    assert [address for address, _ in written].count(row[0]) == 1
    for at, word in enumerate(row[1]):
        robot.program.put(row[0] + 2 * at, word)
    line, true = Line(robot), authenticated(of(programs[4]), key)
    cut = Program(5, true.rows[-1:])
    with pytest.raises(RobotError, match=r"the robot has version 0 and does not ask for version 4: .* \(--key\)"):
        HostNeighbour(line, true, 4.0).send(lambda done, total: None)
    for forged in (of(programs[5]), cut):
        with pytest.raises(RobotError, match=r"does not keep the program after .* tag of the robot's key"):
            HostNeighbour(line, forged, 4.0, key).send(lambda done, total: None)
    assert HostNeighbour(line, true, 4.0, key).send(lambda done, total: None) is False
    with pytest.raises(RobotError, match="the robot has version 4 and does not ask for version 3"):
        Attacker(line, authenticated(Program(3, true.rows), key), 4.0, key).send(lambda done, total: None)
    with pytest.raises(RobotError, match=r"the robot has version 4 and does not activate it: .* \(--key\)"):
        HostNeighbour(line, true, 4.0).activate()
    host = HostNeighbour(line, true, 4.0, key)
    assert host.send(lambda done, total: None) is False
    host.activate()
    run_until_stored(robot, true)


def test_damaged_frames_are_none():
    """Frames with any changed or missing byte are refused."""
    frame = framed(bytes([0x80, 0, 0, 3, 0, 9, 0, 0]))[1:-1]
    assert unframed(frame) == bytes([0x80, 0, 0, 3, 0, 9, 0, 0])
    for at in range(len(frame)):
        assert unframed(frame[:at] + bytes([frame[at] ^ 0x10]) + frame[at + 1 :]) == b""
        assert unframed(frame[:at] + frame[at + 1 :]) == b""
    assert unframed(b"runs 2\n") == unframed(b"") == b""


@pytest.mark.slow
def test_the_command_reaches_a_running_robot_behind_a_pseudo_terminal(robot, programs, capsys):
    master, slave = pty.openpty()
    tty.setraw(slave)
    robot.board.bluetooth.on_byte = lambda byte, _cycle: os.write(master, bytes([byte]))
    words = ["flash", str(programs[4]), "--port", os.ttyname(slave), "--wait", "600", "--json"]
    status: list[int] = []
    host = threading.Thread(target=lambda: status.append(main(words)))
    host.start()
    try:
        while host.is_alive():
            if select.select([master], [], [], 0)[0]:
                robot.board.bluetooth.feed(os.read(master, 4096))
            robot.run(cycles=SLICE)
    finally:
        host.join()
        robot.board.bluetooth.on_byte = None
        os.close(master)
        os.close(slave)
    assert status == [0]
    facts = validated("openswarm", "flash", capsys.readouterr().out)
    program = of(programs[4])
    assert (facts["version"], facts["rows"], facts["crc"], facts["active"]) == (4, ROWS, program.crc, True)
    run_until_stored(robot, program)
