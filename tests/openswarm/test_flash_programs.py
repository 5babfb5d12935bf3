"""`openswarm flash` of programs with simulated robots on a simulated clock.

The robots echo, make no progress, restart the transfer, answer late or fall silent.
tests/firmware/update/test_spreading_on_target.py tests the robot's implementation in C.
"""

from __future__ import annotations

import os
import pty
import random
import select
import threading
import tty
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from emu.chips import chip_named
from emu.host.exit_status import BAD_INPUT, FAULT, INTERRUPTED
from emu.image.model import Block, Image
from emu.image.symbols import Symbol
from openswarm.cli import main
from openswarm.flashing.boot_session import RobotError
from openswarm.flashing.loaders import ROW_BYTES, ROW_UNITS
from openswarm.flashing.messages import (
    NOTHING,
    PARTS,
    Advertisement,
    data,
    framed,
    identity,
    read,
    unframed,
)
from openswarm.flashing.program import SLOT, VERSION_SYMBOL, Program, program_of
from openswarm.flashing.spreading import GREETING_SECONDS, MOST_RESETS, HostNeighbour

HELLO_HEX = Path(__file__).parents[1] / "emu" / "cli" / "hello.hex"
PROGRAM = Program(7, tuple(random.Random(1).randbytes(ROW_BYTES) for _ in range(5)))
ASKS_SECONDS = 0.7
WAIT = 30.0


class Robot:
    """Simulated robot at the other end of a line that receives a program as the firmware does."""

    def __init__(self, version: int = 0) -> None:
        self.time = 0.0
        self.has = Advertisement(version, 1 if version else 0, 5 if version else 0, False)
        self.wants: Advertisement | None = None
        self.row, self.lacking = 0, (1 << PARTS) - 1
        self.says_at, self.asks_at = 1e9, 1e9
        self.outbox: list[tuple[float, bytes]] = []
        self.late: Callable[[], float] = lambda: 0.0
        """Function that returns the delay of the robot's next message in seconds."""
        self.loses: Callable[[bytes], bool] = lambda message: False
        """Function that returns whether a message of the host is lost."""
        self.at_row: Callable[[int], None] = lambda row: None
        """Callback for the start of a request, with the requested row."""

    def now(self) -> float:
        return self.time

    def discard_received(self) -> None:
        self.outbox.clear()

    def say(self, message: bytes) -> None:
        at = max([self.time + self.late(), *(at for at, _ in self.outbox)])
        self.outbox += [(at, bytes([byte])) for byte in framed(message)]

    def read(self, seconds: float) -> bytes:
        limit = self.time + seconds
        while True:
            event = min(self.says_at, self.asks_at, self.outbox[0][0] if self.outbox else 1e9)
            if event > limit:
                self.time = limit
                return b""
            self.time = max(self.time, event)
            if self.outbox and self.outbox[0][0] <= self.time:
                return self.outbox.pop(0)[1]
            if self.says_at <= self.time:
                self.says_at = 1e9
                self.say(self.has.packed())
            if self.asks_at <= self.time:
                self.ask()

    def ask(self) -> None:
        self.asks_at = self.time + ASKS_SECONDS
        assert self.wants is not None
        self.at_row(self.row)
        if self.asks_at < 1e9:
            head = bytes([0xA0 | self.row]) + self.wants.version.to_bytes(2, "little")
            self.say(head + self.lacking.to_bytes(3, "little") + identity(self.wants.crc).to_bytes(2, "little"))

    def begin(self) -> None:
        """Restart the transfer from the first row, as after a reset."""
        self.row, self.lacking = 0, (1 << PARTS) - 1

    def write(self, frames: bytes) -> None:
        for frame in filter(None, frames.split(b"\0")):
            message = unframed(frame)
            assert message
            if not self.loses(message):
                self.hear(message)

    def hear(self, message: bytes) -> None:
        said = read(message)
        if isinstance(said, Advertisement):
            if said.version > self.has.version and said != self.wants:
                self.wants, self.asks_at = said, self.time + ASKS_SECONDS
            elif said.version == self.has.version and said.is_active:
                self.has = said
                self.says_at = self.time + 0.7
            elif said.version < self.has.version or said == NOTHING:
                self.says_at = self.time + 0.7
        elif self.wants is not None and message == data(PROGRAM, self.row, message[1] >> 3):
            self.lacking &= ~(1 << (message[1] >> 3))
            if not self.lacking:
                self.row, self.lacking = self.row + 1, (1 << PARTS) - 1
                self.asks_at = self.time + ASKS_SECONDS
            if self.row == self.wants.rows:
                self.has, self.wants, self.asks_at, self.says_at = self.wants, None, 1e9, self.time + 0.5


def send_program(robot: Any, program: Program = PROGRAM, wait: float = WAIT) -> tuple[HostNeighbour, list[int]]:
    rows: list[int] = []
    neighbour = HostNeighbour(robot, program, wait)
    if not neighbour.send(lambda done, total: rows.append(done)):
        neighbour.activate()
    return neighbour, rows


def test_a_robot_takes_it_whatever_is_lost_and_however_late_it_speaks():
    for late in (0.0, 3 * GREETING_SECONDS):
        robot, draw = Robot(3), random.Random(4)
        robot.late = lambda late=late: late
        robot.loses = lambda message, draw=draw: draw.random() < 0.3
        neighbour, rows = send_program(robot, wait=200.0)
        assert robot.has == Advertisement(7, 5, PROGRAM.crc, True)
        assert rows[-1] == 5
        assert neighbour.counts.resets == 0


def test_a_line_that_echoes_is_reported_and_not_trusted():
    """A line that echoes is refused: the host's own advertisement would pass for that of a robot that has the
    program."""

    class Echo(Robot):
        def hear(self, message: bytes) -> None:
            self.say(message)

    with pytest.raises(RobotError, match="the line sends back what is written to it"):
        send_program(Echo())


def test_the_command_tells_an_echo(tmp_path, capsys):
    master, slave = pty.openpty()
    tty.setraw(slave)
    is_over = threading.Event()

    def echo() -> None:
        while not is_over.is_set():
            if select.select([master], [], [], 0.02)[0]:
                os.write(master, os.read(master, 1000))

    thread = threading.Thread(target=echo)
    thread.start()
    try:
        assert main(["flash", str(built(tmp_path)), "--port", os.ttyname(slave)]) == FAULT
    finally:
        is_over.set()
        thread.join()
        os.close(master)
        os.close(slave)
    assert "the line sends back what is written to it: switch its echo off" in capsys.readouterr().err


def built(folder: Path) -> Path:
    (folder / "lamp.c").write_text("int main(void) { return 0; }\n")
    out = folder / "lamp.elf"
    assert main(["program", str(folder / "lamp.c"), "--version", "7", "-o", str(out)]) == 0
    return out


def test_requests_without_progress_end_the_transfer():
    """The transfer ends with an error if the robot makes no progress.

    The robot requests one row for ever, or different rows in turn, always with a missing part.
    """
    robot = Robot()
    robot.loses = lambda message: message[0] == 0xC2
    with pytest.raises(RobotError, match="the robot repeats its request for row 2: it keeps the rows that it has"):
        send_program(robot)
    assert robot.time < 2 * WAIT
    robot = Robot()
    robot.loses = lambda message: message[0] == 0xC3 and message[1] >> 3 == robot.time // 5 % 2
    robot.at_row = lambda row: setattr(robot, "lacking", robot.lacking | 3 * (row == 3))
    with pytest.raises(RobotError, match="repeats its request for row 3"):
        send_program(robot)
    assert robot.time < 3 * WAIT


def test_silence_is_reported_with_the_row():
    robot = Robot()
    robot.at_row = lambda row: row == 3 and setattr(robot, "asks_at", 1e9)
    with pytest.raises(RobotError, match="the robot fell silent at row 2: it keeps the rows that it has"):
        send_program(robot)
    deaf = Robot()
    deaf.loses = lambda message: True
    with pytest.raises(RobotError, match="no robot answered within 30 s"):
        send_program(deaf)
    assert deaf.time < 2 * WAIT


@pytest.mark.parametrize("resets", [MOST_RESETS, MOST_RESETS + 1])
def test_the_robot_may_restart_the_transfer_some_times(resets: int):
    robot, left = Robot(), [resets]

    def reset(row: int) -> None:
        if row == 4 and left[0]:
            left[0] -= 1
            robot.begin()
            robot.asks_at = 1e9
            robot.wants = None
            robot.says_at = robot.time + 1.0

    robot.at_row = reset
    if resets <= MOST_RESETS:
        assert send_program(robot)[0].counts.resets == resets
    else:
        with pytest.raises(RobotError, match=rf"the transfer {resets} times, last from row 3: it resets during"):
            send_program(robot)


@pytest.mark.parametrize(("version", "says"), [
    (8, "has version 8 and accepts only a higher one: build the program with --version 9 or more"),
    (65_534, "build the program with --version 65535"),
    (65_535, "has version 65535 and accepts only a higher one: there is none"),
])  # fmt: skip
def test_what_is_not_newer_is_refused_with_what_would_be(version: int, says: str):
    with pytest.raises(RobotError, match=says):
        send_program(Robot(version))


def test_the_last_version_is_taken():
    robot = Robot(65_534)
    neighbour = HostNeighbour(robot, Program(65_535, PROGRAM.rows), WAIT)
    assert neighbour.send(lambda done, total: None) is False


def image(version: int | None, *blocks: tuple[int, list[int]], chip: str = "dsPIC30F6014A") -> Image:
    symbols = [] if version is None else [Symbol(VERSION_SYMBOL, version, 0, "label", "absolute", True, None)]
    made = tuple(Block(base, array("I", words), "test") for base, words in blocks)
    return Image("test.elf", "elf", chip_named(chip), made, raw_symbols=tuple(symbols))


def test_what_is_no_program_is_reported():
    start = (SLOT.start, [0] * 3)
    made = program_of(image(1, start))
    assert (made.version, len(made.rows), len(made.rows[0])) == (1, 1, ROW_BYTES)
    assert program_of(image(65_535, (SLOT.start, [0]), (SLOT.end - 2, [0]))).rows[31][-3:] == bytes(3)
    for version in (0, 65_536, 70_000):
        with pytest.raises(ValueError, match=rf"is of version {version}; expected 1 to 65535"):
            program_of(image(version, start))
    with pytest.raises(ValueError, match="has no __update_version: expected the ELF file that `openswarm program`"):
        program_of(image(None, start))
    with pytest.raises(ValueError, match="has nothing at 0x00f800, where programs begin"):
        program_of(image(1, (SLOT.start + ROW_UNITS, [0])))
    with pytest.raises(ValueError, match="has words at 0x010000, outside of the slot"):
        program_of(image(1, start, (SLOT.end, [0])))


def test_files_of_the_wrong_kind_are_one_line(tmp_path, capsys):
    def said(*words: str) -> str:
        assert main(["flash", *words, "--port", "/dev/null"]) == BAD_INPUT
        told = capsys.readouterr()
        assert (told.out, told.err.count("\n")) == ("", 1), told
        return told.err

    lamp = built(tmp_path)
    capsys.readouterr()
    assert "is no serial port" in said(str(lamp))
    as_hex = tmp_path / "lamp.hex"
    as_hex.write_text(f":020000040001F9\n:10F00000{bytes(17).hex()}\n:00000001FF\n")
    assert "has no __update_version: expected the ELF file that `openswarm program` made" in said(str(as_hex))
    assert "--store is for programs that `openswarm program` has built" in said(str(HELLO_HEX), "--store")
    broken = tmp_path / "broken.elf"
    broken.write_bytes(lamp.read_bytes()[:200])
    assert str(broken) in said(str(broken))
    assert str(tmp_path / "lamp.c") in said(str(tmp_path / "lamp.c"))


@pytest.mark.parametrize(("error", "status", "says"), [
    (KeyboardInterrupt(), INTERRUPTED, "interrupted; 3 of 5 rows are written, the robot keeps them until a reset"),
    (OSError("/dev/x is gone"), BAD_INPUT, "/dev/x is gone; 3 of 5 rows are written, the robot keeps them"),
])  # fmt: skip
def test_who_stops_in_the_middle_hears_what_was_reached(error, status, says, tmp_path, capsys, monkeypatch):
    class Port(Robot):
        def __init__(self, device: str, baud: int) -> None:
            super().__init__()

        def __enter__(self) -> Port:
            return self

        def __exit__(self, *what: object) -> None:
            pass

        def hear(self, message: bytes) -> None:
            if message[0] == 0xC3:
                raise error
            super().hear(message)

    monkeypatch.setattr("openswarm.commands.flash.SerialPort", Port)
    monkeypatch.setattr("openswarm.commands.flash.program_of", lambda image: PROGRAM)
    lamp = built(tmp_path)
    capsys.readouterr()
    assert main(["flash", str(lamp), "--port", "/dev/x"]) == status
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.splitlines()[1:] == [f"openswarm flash: {told.err.splitlines()[1].partition(': ')[2]}"]
    assert says in told.err
    assert told.err.endswith("run the command again\n")
