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
        robot.uart.expect("hello from @PROJECT@\r\n", within_ms=1100)
        ends.append(robot.cycle)
    assert ends[2] - ends[1] == pytest.approx(emu.FCY_HZ, rel=1e-3)  # cycles per second


def test_the_body_led_follows(robot):
    robot.run(ms=500)
    assert robot.board.leds["body"]
    robot.run(ms=1000)
    assert not robot.board.leds["body"]


def test_threads_leave_room_on_their_stacks(robot):
    robot.run(ms=2000)
    assert robot.stack("greet").free >= 8


def test_greeting_is_quick(robot):
    with robot.measured() as measured:
        robot.run(ms=2500)
    assert measured.cycles("Sys_Send_Event").most < 1000
    assert measured.coverage("main.c") >= 0.8  # main never returns
