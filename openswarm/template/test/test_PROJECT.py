"""Tests of @PROJECT@ on the emulated robot: `make test`. They run the image that is flashed into a robot.

OpenSwarm's pytest plugin provides the fixture `robot`. A failed test writes its artefacts (thread, source line,
waveform) to robot-artefacts/.
"""

import pytest

import emu

pytestmark = pytest.mark.firmware("..")  # the folder that contains the Makefile


def test_it_greets_every_second(robot):
    ends = []
    for _ in range(3):
        robot.uart[1].expect("hello from @PROJECT@\r\n", within=1100)  # simulated ms
        ends.append(robot.cycle)
    assert ends[2] - ends[1] == pytest.approx(emu.FCY_HZ, rel=1e-3)  # cycles per second


def test_the_handler_sets_the_body_led(robot):
    robot.run(seconds=0.5)
    assert robot.board.leds["body"]
    robot.run(seconds=1)
    assert not robot.board.leds["body"]


def test_threads_leave_room_on_their_stacks(robot):
    robot.run(seconds=2)
    assert robot.stack("greet").free >= 8
    assert robot.stack("beat").free >= 8


def test_sending_is_quick(robot):
    with robot.measured() as measured:
        robot.run(seconds=2.5)
    assert measured.cycles("on_beat").most < 100
    assert measured.coverage("main.c") >= 0.8  # main never returns
