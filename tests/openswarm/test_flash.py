"""`openswarm flash` with a simulated boot loader on a simulated clock.

The line to the loader can lose, damage and delay bytes. tests/firmware/update/test_boot_on_target.py tests the
loader in C.
"""

from __future__ import annotations

import contextlib
import os
import pty
import re
import sys
import termios
from array import array
from collections.abc import Callable
from pathlib import Path

import pytest

from emu.chips import chip_named
from emu.host.exit_status import BAD_INPUT, FAULT
from emu.image.loader import load_image
from emu.image.model import Block, Image
from openswarm.cli import main
from openswarm.flashing.boot_session import TRIES, BootSession, RobotError
from openswarm.flashing.loaders import LOADERS, Loader
from openswarm.flashing.rows import goto, rows
from openswarm.flashing.serial import SerialPort

HELLO_HEX = Path(__file__).parents[1] / "emu" / "cli" / "hello.hex"
TINYBLD = LOADERS[0x71]
BOOT = Path(__file__).parents[2] / "firmware" / "apps" / "boot"


def image(*blocks: tuple[int, list[int]]) -> Image:
    """Return an image with a reset vector to 0x100 and the given (address, words) blocks."""
    made = [Block(0, array("I", goto(0x100)), "reset")]
    made += [Block(base, array("I", words), "test") for base, words in blocks]
    return Image("test.elf", "elf", chip_named(), tuple(made))


class Robot:
    """Simulated tinybld loader and its line: bytes arrive at once, and a pause of a second ends a conversation."""

    def __init__(self, kind: int = 0x71) -> None:
        self.flash: dict[int, bytes] = {}
        self.time = 0.0
        self.heard_at = 0.0
        self.type = kind
        self.inbox = b""
        """Received bytes of the current block."""
        self.greeted = False
        self.starts: list[int] = []
        self.outbox: list[tuple[float, bytes]] = []
        self.spoil: Callable[[int, bytes], bytes] = lambda number, data: data
        """Function that returns the received bytes of the n-th write of the host."""
        self.delay: Callable[[int], float] = lambda number: 0.0
        self.written = 0

    def now(self) -> float:
        return self.time

    def discard_received(self) -> None:
        self.outbox = [one for one in self.outbox if one[0] > self.time]

    def read(self, seconds: float) -> bytes:
        limit = self.time + seconds
        if self.outbox and self.outbox[0][0] <= limit:
            at, byte = self.outbox.pop(0)
            self.time = max(self.time, at)
            return byte
        self.time = limit
        return b""

    def write(self, data: bytes) -> None:
        self.written += 1
        if self.greeted and self.time - self.heard_at > 1.0:
            self.greeted, self.inbox = False, b""
        for byte in self.spoil(self.written, data):
            self.heard_at = self.time
            self._take(byte)

    def _say(self, data: bytes) -> None:
        at = self.time + self.delay(self.written)
        self.outbox += [(at, bytes([byte])) for byte in data]

    def _take(self, byte: int) -> None:
        if not self.greeted:
            if byte == 0xC1:
                self.greeted = True
                self._say(bytes([self.type]) + b"K")
            return
        self.inbox += bytes([byte])
        if len(self.inbox) == 4 and byte == 0xFF:
            self.starts.append(int.from_bytes(self.inbox[:2], "little"))
            self.greeted, self.inbox = False, b""
        elif len(self.inbox) == 4 + 96 + 1:
            whole, self.inbox = self.inbox, b""
            if sum(whole) & 0xFF:
                self._say(b"N")
            else:
                self.flash[int.from_bytes(whole[:3], "little")] = whole[4:100]
                self._say(b"K")


def words_of(row: bytes) -> list[int]:
    return [int.from_bytes(row[i : i + 3], "little") for i in range(0, 96, 3)]


def flash_image(robot: Robot, what: Image) -> BootSession:
    talk = BootSession(robot, 5.0)
    talk.write(rows(what, talk.loader), lambda done, total: None)
    talk.start()
    return talk


WHAT = image((0x100, list(range(100))), (0x8000, [0xABCDEF]))


def holds_what(robot: Robot) -> bool:
    loader = LOADERS[robot.type]
    first, entry = words_of(robot.flash[0]), words_of(robot.flash[loader.entry_row])
    slot = (loader.entry - loader.entry_row) // 2
    data = words_of(robot.flash[0x100] + b"")[:32] + words_of(robot.flash[0x140])
    assert set(robot.flash) == {address for address, _ in rows(WHAT, loader)}
    return (first[:2], entry[slot : slot + 4], data[:64], words_of(robot.flash[0x8000])[0], robot.starts) == (
        goto(loader.start), [*goto(0x100), 0xFFFFFF, 0xFFFFFF], list(range(64)), 0xABCDEF, [1])  # fmt: skip


@pytest.mark.parametrize("kind", LOADERS)
def test_an_image_arrives_and_the_loader_keeps_what_is_its_own(kind):
    """Flashing writes the image: reset leads to the loader, the loader's entry to the program.

    No row of the loader itself is sent.
    """
    robot = Robot(kind)
    talk = flash_image(robot, WHAT)
    assert holds_what(robot)
    assert max(robot.flash) == talk.loader.entry_row < talk.loader.start
    assert (talk.counts.refused, talk.counts.unanswered) == (0, 0)


def test_the_entry_leads_into_the_loader_until_all_is_there():
    """An interrupted transfer leaves a robot that enters its boot loader: the first row erases the entry, the last
    sets it."""
    order = rows(WHAT, TINYBLD)
    slot = (TINYBLD.entry - TINYBLD.entry_row) // 2
    assert order[0][0] == order[-1][0] == TINYBLD.entry_row
    assert order[0][1][slot : slot + 4] == [0xFFFFFF] * 4
    assert order[-1][1][slot : slot + 2] == goto(0x100)
    assert TINYBLD.entry + 8 == TINYBLD.start  # the erased words are NOPs that lead into the loader
    assert [address for address, _ in order[1:-1]] == sorted({address for address, _ in order[1:-1]})


def test_the_image_keeps_what_lies_before_the_entry():
    what = image((0x100, [0]), (TINYBLD.entry_row, [7] * 4))
    assert [words[:4] for address, words in rows(what, TINYBLD) if address == TINYBLD.entry_row] == [[7] * 4] * 2


def test_damaged_lost_and_doubled_bytes_cost_time_and_nothing_else():
    """Damaged, lost and duplicated bytes cost time only.

    Write 4 has a wrong bit, write 7 loses bytes, write 9 is lost. A superfluous greeting shifts the first block by a
    byte; if it were repeated at once, the loader would accept it in rotated form.
    """
    robot = Robot()

    def spoil(number: int, data: bytes) -> bytes:
        if len(data) == 1:
            return data * (1 + (number == 1))
        wrong = data[:50] + bytes([data[50] ^ 4]) + data[51:] if len(data) > 50 else data
        return {4: wrong, 7: data[:60], 9: b""}.get(number, data)

    robot.spoil = spoil
    counts = flash_image(robot, WHAT).counts
    assert holds_what(robot)
    assert counts.refused >= 2
    assert counts.unanswered >= 2
    assert counts.blocks == len(rows(WHAT, TINYBLD)) + counts.refused + counts.unanswered


def test_every_byte_of_a_block_may_be_lost():
    for lost in range(101):
        robot = Robot()
        robot.spoil = lambda number, data, lost=lost: data[:lost] + data[lost + 1 :] if number == 3 else data
        flash_image(robot, WHAT)
        assert holds_what(robot), lost


def test_slow_answers_are_waited_for():
    robot = Robot()
    robot.delay = lambda number: 0.9 if number > 1 else 0.0
    assert flash_image(robot, WHAT).counts.unanswered == 0
    assert holds_what(robot)


def test_a_row_that_is_refused_for_ever_ends_the_attempt():
    robot = Robot()
    robot.spoil = lambda number, data: data[:-1] + bytes([data[-1] ^ 1]) if data[:3] == bytes(3) else data
    with pytest.raises(RobotError, match=rf"refused the row at 0x000000 {TRIES} times"):
        flash_image(robot, WHAT)
    assert robot.starts == []
    robot = Robot()
    robot.spoil = lambda number, data: b"" if len(data) > 4 else data
    with pytest.raises(RobotError, match=f"did not acknowledge the row at 0x017f00 {TRIES} times"):
        flash_image(robot, WHAT)


def test_nobody_answers_or_somebody_else():
    robot = Robot()
    robot.spoil = lambda number, data: b""
    with pytest.raises(RobotError, match="no boot loader answered within 5 s: press"):
        BootSession(robot, 5.0)
    with pytest.raises(RobotError, match=r"type 0x70 answers; expected 0x71 \(tinybld\) or 0x91"):
        BootSession(Robot(0x70), 5.0)
    talker = Robot()
    talker.spoil = lambda number, data: b""
    talker.write = lambda data: talker._say(b"hello, swarm\r\n")  # type: ignore[method-assign]
    with pytest.raises(RobotError, match="bytes of something else came"):
        BootSession(talker, 5.0)


@pytest.mark.parametrize("loader", LOADERS.values(), ids=lambda one: one.name)
def test_an_image_over_the_loader_is_refused(loader: Loader):
    for address in (loader.entry, loader.start, 0x017FFE):
        with pytest.raises(ValueError, match=rf"words at {address:#08x}, where the robot's boot loader"):
            rows(image((0x100, [0]), (address, [1])), loader)
    rows(image((0x100, [0]), (loader.entry - 2, [1]), (0x017FFE, [0xFFFFFF])), loader)


def test_what_cannot_be_flashed_is_one_line(tmp_path, capsys):
    def said(*words: str) -> str:
        assert main(["flash", *words]) == BAD_INPUT
        told = capsys.readouterr()
        assert (told.out, told.err.count("\n")) == ("", 1), told
        return told.err

    text = tmp_path / "text"
    text.write_text("no image")
    assert "neither ELF nor Intel HEX" in said(str(text), "--port", "/dev/null")
    text.write_text(":0400000000000000FC\n:00000001FF\n")
    assert "no GOTO at its reset vector" in said(str(text), "--port", "/dev/null")
    assert "No such file" in said(str(HELLO_HEX), "--port", str(tmp_path / "none"))
    assert "is no serial port" in said(str(HELLO_HEX), "--port", str(text))
    for wrong in ("0", "-1", "nan", "inf", "x"):
        with pytest.raises(SystemExit):
            main(["flash", str(HELLO_HEX), "--port", "x", f"--wait={wrong}"])


@pytest.mark.parametrize("target", [0x101, 0x102, 0x018000, 0x7FFFFE])
def test_a_goto_has_to_lead_to_a_program(target: int):
    """The reset GOTO must lead to a flash word of the image; other and odd targets are refused."""
    wrong = image((0x100, [0]))
    wrong.blocks[0].words[0] = 0x040000 | target & 0xFFFF
    wrong.blocks[0].words[1] = target >> 16
    with pytest.raises(ValueError, match=rf"the GOTO .* leads to {target:#08x}, where the image has no program"):
        rows(wrong, TINYBLD)


def test_a_line_with_an_echo_acknowledges_nothing():
    """An echo on the line is refused: the loader's 'K' could be an echoed byte of a row."""
    robot = Robot()
    heard = robot.write

    def write(data: bytes) -> None:
        robot._say(data)
        heard(data)

    robot.write = write  # type: ignore[method-assign]
    robot.spoil = lambda number, data: data if len(data) == 1 else b""
    with pytest.raises(RobotError, match="the line sends back what is written to it: switch its echo off"):
        flash_image(robot, image((0x100, [0x4B4B4B])))


def test_an_image_for_another_chip_is_refused():
    """An image for a chip whose flash ends before the known loaders is refused."""
    other = Image("small.elf", "elf", chip_named("dsPIC30F4013"), image().blocks)
    with pytest.raises(ValueError, match=r"small\.elf: is for the dsPIC30F4013, for which no boot loader is known"):
        rows(other, TINYBLD)


def test_a_port_that_vanishes_or_takes_nothing_is_one_error(monkeypatch):
    """A port that vanishes or accepts no bytes gives one error for every following operation.

    `termios` raises its own exception type, which must be converted.
    """
    monkeypatch.setattr("openswarm.flashing.serial._STUCK_SECONDS", 0.05)
    master, slave = pty.openpty()
    termios.tcflow(slave, termios.TCOOFF)
    with SerialPort(os.ttyname(slave), 115_200) as port:
        with pytest.raises(OSError, match="takes no bytes"):
            port.write(b"row")
        os.close(slave)
        os.close(master)
        port.discard_received()
        with pytest.raises(OSError, match=r"/dev/pts/\d+ is gone: Input/output error"):
            port.write(b"row")
        with pytest.raises(OSError, match="closed at its other end"):
            port.read(0.1)


def test_what_ends_the_progress_has_a_line_of_its_own(monkeypatch, capsys):
    class Vanishing(BootSession):
        def __init__(self, line: object, wait: float) -> None:
            self.loader = TINYBLD  # type: ignore[misc]

        def write(self, rows: object, progress: Callable[[int, int], None]) -> None:
            progress(3, 5)
            raise OSError("/dev/x is gone")

    monkeypatch.setattr("openswarm.commands.flash.BootSession", Vanishing)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    master, slave = pty.openpty()
    assert main(["flash", str(HELLO_HEX), "--port", os.ttyname(slave)]) == BAD_INPUT
    os.close(master)
    os.close(slave)
    assert capsys.readouterr().err.endswith(
        "3 of 5 rows\nopenswarm flash: /dev/x is gone; 3 of 5 rows are written, the robot waits in its boot loader:"
        " run the command again\n"
    )


def test_the_terminal_of_the_command_is_no_port():
    """The controlling terminal is refused as a port, because it would remain in raw mode."""
    child, terminal = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-m", "openswarm", "flash", str(HELLO_HEX), "--port", "/dev/tty"])
    said = b""
    with contextlib.suppress(OSError):  # at its end
        while more := os.read(terminal, 1000):
            said += more
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == BAD_INPUT
    assert said == b"openswarm flash: /dev/tty is the terminal in which this runs, no serial port\r\n"


def test_a_port_where_nobody_is_ends_with_status_1(capsys):
    master, slave = pty.openpty()
    try:
        assert main(["flash", str(HELLO_HEX), "--port", os.ttyname(slave), "--wait", "0.1"]) == FAULT
        assert "no boot loader answered within 0.1 s: press the robot's reset button" in capsys.readouterr().err
    finally:
        os.close(master)
        os.close(slave)


def test_the_image_of_the_tests_has_a_reset_vector():
    assert rows(load_image(HELLO_HEX), TINYBLD)[1][1][:2] == goto(TINYBLD.start)


def test_our_loader_lies_where_the_host_believes_it() -> None:
    """Address and type of this project's loader are equal in its C source and in loaders.py."""
    (start,) = re.findall(r"#define BOOT_START (0x[0-9A-F]+)", (BOOT / "boot.h").read_text())
    (type_,) = re.findall(r"TYPE = (0x[0-9A-F]+)", (BOOT / "main.c").read_text())
    assert LOADERS[int(type_, 16)].start == int(start, 16)
