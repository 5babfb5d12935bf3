"""What @PROJECT@ does, on the emulated robot: `make test`. The image is the one a robot is flashed with."""

from pathlib import Path

import pytest

import emu

FIRMWARE = Path(__file__).parents[1] / "build" / "firmware.elf"


@pytest.fixture
def robot():
    """An e-puck that has just been switched on."""
    return emu.load(FIRMWARE)


def test_it_greets_every_second(robot):
    said = []
    robot.uart[1].listen(lambda byte, cycle: said.append((chr(byte), cycle)))
    robot.run(seconds=2.5)
    assert "".join(letter for letter, _ in said) == "hello from @PROJECT@\r\n" * 3
    ends = [cycle for letter, cycle in said if letter == "\n"]
    assert ends[1] - ends[0] == pytest.approx(emu.FCY_HZ, rel=1e-3)  # cycles of a second


def test_the_body_led_follows(robot):
    robot.run(seconds=0.5)
    assert robot.board.leds["body"]
    robot.run(seconds=1)
    assert not robot.board.leds["body"]


def test_threads_leave_room_on_their_stacks(robot):
    robot.run(seconds=2)
    for thread in robot.threads():
        if thread.free is not None:
            assert thread.free >= 8, f"{thread}: {thread.used} bytes used"
