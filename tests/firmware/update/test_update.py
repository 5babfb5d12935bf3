"""Program updates (io/update): whenever power fails, the old or the new program runs afterwards."""

from __future__ import annotations

import re
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest

import emu
from emu.dspic30f.isa.text import parse
from emu.machine.machine import Machine
from openswarm.flashing.loaders import ROW_BYTES
from openswarm.flashing.messages import MESSAGE, PARTS, Advertisement, Request, framed, identity, read, unframed
from openswarm.flashing.messages import data as part_of
from openswarm.flashing.program import ROWS as SLOT_ROWS
from openswarm.flashing.program import Program
from tests.firmware.update.host_programs import on_host
from tests.watchdog import HANG

HERE = Path(__file__).parent
OPENSWARM = HERE.parents[2] / "firmware" / "openswarm"
TARGET_APPS = HERE.parent / "target"
RECEIVE, ACTIVATE, CONFIRM = 1, 2, 3
ROWS = 1
MARK = 0x1F00
"""RAM address at which the programs of this test store their version."""
RUN, STORES = 0x00F800, 0x016800
OPERATIONS = 11
"""Number of flash and EEPROM operations of an update.

Erase head and flags; erase and write a row and the head; activate; count a trial; copy the row; confirm.
"""
MIDDLE = 20_000
"""Tcy after the start of an operation at which power fails; an operation takes 29,491 Tcy."""


def test_every_operation_may_be_the_last_and_damage_is_refused(tmp_path):
    """Power may fail at each operation of an update and of the next start; 10,000 damaged images are refused.

    The failing operation has not happened, has happened or has changed some bits. The program runs on a host under
    sanitizers.
    """
    said = on_host("power", tmp_path)
    assert [int(pairs) for pairs in re.findall(r"(\d+) pairs", said)] == [203, 351, 93]
    assert int(re.search(r"(\d+) damaged images refused", said)[1]) >= 10_000


def test_a_program_reaches_every_robot(tmp_path):
    """Updates reach all robots of swarms of 2, 3 and 30, over ten hops, with 30 % of the messages lost.

    All robots activate and run the program and then stop sending. In a swarm of ten, a deaf robot and a greedy robot
    request rows without end; the ten robots still get the program (nine of them within 10 min). Random messages do
    no harm.
    """
    said = on_host("swarm", tmp_path)
    trials = re.findall(r"(\d+) robots, .* (\d) nag: .* active ([\d.]+) s, .* then (\d+) in 300 s", said)
    assert [(int(robots), int(nag)) for robots, nag, _, _ in trials] == [(2, 0), (3, 0), (30, 0), (12, 2)] * 2
    for robots, nag, seconds, frames in trials:
        assert 0 < float(seconds) < 600
        # each sends after 1, 2, 4 s and so on, or not at all if others send the same
        assert nag != "0" or int(frames) < 9 * int(robots)
    assert said.endswith("whatever was said\n")


def test_neighbours_may_say_anything(tmp_path):
    """150 random histories under sanitizers leave programs whole and robots silent when no message arrives.

    They contain false advertisements, two programs of one version, requests for missing rows, power failures, worn
    flash and a wrapping clock. Robots stop requesting an advertised program that no robot sends.
    """
    said = on_host("hostile", tmp_path)
    assert int(re.search(r"(\d+) messages", said)[1]) > 100_000


def test_host_and_robot_have_one_format(tmp_path):
    """Host and firmware agree on sizes, on every kind of message and on frames."""
    lines = [line.split() for line in on_host("format", tmp_path).splitlines()]
    sizes = {name: int(number) for name, number, *frame in lines if not frame}
    assert sizes == {"row": ROW_BYTES, "rows": SLOT_ROWS, "parts": PARTS, "message": MESSAGE}
    said = [(name, bytes.fromhex(message), bytes.fromhex(frame)) for name, message, *rest in lines for frame in rest]
    for _, message, frame in said:
        assert framed(message) == frame
        assert unframed(frame[1:-1]) == message
    rows = tuple(bytes((row * 7 + at * 3) & 0xFF for at in range(ROW_BYTES)) for row in range(1, 4))
    program = Program(0xA123, rows)
    stored, active = (Advertisement(program.version, 3, program.crc, is_active) for is_active in (False, True))
    assert [message for _, message, _ in said[:2]] == [stored.packed(), active.packed()]
    asked = Request(program.version, 2, 0x80001, identity(program.crc))
    assert [read(message) for _, message, _ in said[:3]] == [stored, active, asked]
    assert [message for _, message, _ in said[3:]] == [part_of(program, 2, part) for part in range(PARTS)]


class Number:
    """Interface of an operand that the assembly parser expects."""

    def __init__(self, text: str) -> None:
        self.value: int | None = int(text, 0)


def rows_of(version: int) -> bytes:
    """Return a program of one row that stores its version at MARK."""
    words: list[int] = []
    for line in (f"mov #{version}, w0", f"mov w0, {MARK:#x}", "return"):
        words += parse(line, Number).encode(RUN + 2 * len(words))
    words += [0xFFFFFF] * (ROWS * ROW_BYTES // 3 - len(words))
    return b"".join(word.to_bytes(3, "little") for word in words)


class Robot:
    """A robot that receives commands through its RAM."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.stops_at_operations = False
        machine.hook_pc("operate", lambda: self.stops_at_operations)
        machine.hook_pc("ready", lambda: True)

    def run(self) -> bool:
        """Run to the next stop; return whether it is the start of a flash or EEPROM operation."""
        self.machine.run(cycles=1)
        stop = self.machine.run(seconds=2.0)
        assert stop.reason == "breakpoint", stop
        return self.machine.pc == self.machine.program_address("operate")

    def boot(self, cause: str) -> int:
        """Reset and return the version that runs; 0 is the firmware alone."""
        self.machine.reset(cause)
        self.machine.record.bytes[MARK : MARK + 2] = bytes(2)
        while self.run():
            pass
        assert self.machine.peek("version") == self.machine.peek(MARK)
        return self.machine.peek(MARK)

    def tell(self, command: int, version: int) -> None:
        program = rows_of(version)
        facts = version.to_bytes(2, "little") + bytes([ROWS, 0]) + zlib.crc32(program).to_bytes(4, "little")
        for name, data in (("facts", facts), ("bytes", program), ("command", bytes([command, 0]))):
            at = self.machine.address_of(name)
            self.machine.record.bytes[at : at + len(data)] = data


def after_a_failure_here(robot: Robot, old: int, new: int) -> set[int]:
    """Cut the operation that starts now and return the versions that run afterwards.

    Once power fails, and once the reset line is activated; both leave an erased row half erased (dspic30f6014a.md
    §16).
    """
    here = robot.machine.snapshot()
    seen = set()
    robot.stops_at_operations = False
    for cause in ("POR", "EXTR"):
        robot.machine.run(cycles=MIDDLE)
        version = robot.boot(cause)
        assert version in (old, new), cause
        seen.add(version)
        robot.machine.restore(here)
    robot.stops_at_operations = True
    return seen


def test_no_image_reaches_into_the_slots(image, tmp_path):
    """No image places code or data in the update slots; an image that would need them is not linked."""
    program = emu.load(image("updates", TARGET_APPS)).program
    kept = [*range(RUN, 0x10000, 2), *range(STORES, 0x18000, 2)]
    assert all(program.word(address) == 0xFFFFFF for address in kept)
    large = tmp_path / "large.s"
    large.write_text(".global _main\n_main: return\n.section .large, code, keep\n.space 0xF800\n")
    slots = OPENSWARM / "board" / "epuck" / "update" / "update_slots.S"
    done = subprocess.run([sys.executable, "-m", "toolchain", "cc", slots, large, "-o", tmp_path / "large.elf"],
                          capture_output=True, text=True, check=False, timeout=HANG)  # fmt: skip
    assert done.returncode == 2
    assert "at fixed addresses: .update_run 0xf800..0xffff, .update_stores 0x16800..0x17fff" in done.stderr


@pytest.mark.slow
def test_power_fails_at_every_write_of_a_robot(image):
    """Power failure at each flash or EEPROM operation of an update leaves a robot that runs a whole program.

    The code for the chip runs on the emulated flash and EEPROM; snapshots restore the state before each operation.
    """
    robot = Robot(emu.load(image("updates", TARGET_APPS)))
    assert robot.boot("POR") == 0
    assert update(robot, 1, lambda: None) == OPERATIONS
    seen: set[int] = set()
    assert update(robot, 2, lambda: seen.update(after_a_failure_here(robot, 1, 2))) == OPERATIONS
    assert seen == {1, 2}


def update(robot: Robot, version: int, at_each: Callable[[], None]) -> int:
    """Install and run a version; return the number of operations."""
    operations = 0
    robot.stops_at_operations = True
    for command in (RECEIVE, ACTIVATE, None, CONFIRM):
        if command is None:
            robot.machine.reset("POR")
        else:
            robot.tell(command, version)
        while robot.run():
            operations += 1
            at_each()
        assert robot.machine.peek("refused") == 0
    robot.stops_at_operations = False
    assert robot.boot("POR") == version
    return operations
