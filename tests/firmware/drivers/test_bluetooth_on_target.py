"""The Bluetooth text protocol, LED orders, sound and motion events, on the emulated robot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from emu.machine.machine import Machine
from emu.peripherals.uart.rx_queue import FRAMING_ERROR
from tests.cases import check_all
from tests.firmware.conftest import Build
from tests.firmware.drivers.test_drivers_on_target import FCY, robot, steps

pytestmark = pytest.mark.slow

LINE_TIME = FCY // 20
EVENTS = {"left": 2, "selector": 8, "proximity": 0x11, "motion": 0x12, "sound": 0x13, "led": 0x14}


SELECTOR = 6


@pytest.fixture(scope="module")
def reported(image: Build) -> tuple[Path, bytes]:
    """Return the image of the self-test and the robot's state after its report."""
    machine = robot(image("selftest"), selector=SELECTOR)
    heard = bytearray()
    machine.uart[1].on_byte = lambda byte, _cycle: heard.append(byte)
    while b"end\r\n" not in heard:
        assert machine.run(cycles=FCY // 10).reason == "limit"
    return image("selftest"), machine.snapshot()


@pytest.fixture
def talk(reported: tuple[Path, bytes]) -> tuple[Machine, Callable[..., list[str]]]:
    """Return the self-test after its report, and a function that sends lines and returns the answers.

    The function collects answers until LINE_TIME after the last line.
    """
    path, state = reported
    machine = robot(path, selector=SELECTOR)
    machine.restore(state)
    heard = bytearray()
    machine.uart[1].on_byte = lambda byte, _cycle: heard.append(byte)

    def ask(*lines: str, wait: int = LINE_TIME) -> list[str]:
        heard.clear()
        for line in lines:
            machine.uart[1].feed(line.encode() + b"\r")
            machine.run(cycles=wait)
        return heard.decode("latin-1").split("\r\n")[:-1]

    return machine, ask


def test_commands_drive_the_robot_and_are_answered(talk) -> None:
    """The SerCom commands D E L B F C S move the robot and are answered (epuck.md §6).

    500 steps/s are 64.5 mm/s. The driver stores 65 mm/s, which are 504 steps/s.
    """
    machine, ask = talk
    assert ask("D,500,-1000") == ["d"]
    before = steps(machine)
    machine.run(cycles=FCY)
    made = [now - then for now, then in zip(steps(machine), before, strict=True)]
    assert made == pytest.approx([65 * 1000 / 129, -1000], abs=1)
    assert ask("E") == ["e,504,-1000"]
    assert ask("L,3,1", "L,9,1", "B,2") == ["l", "l", "b"]
    assert machine.board.leds.lit == ("led3", "front", "body")
    assert ask("F,0", "L,3,2") == ["f", "l"]
    assert machine.board.leds.lit == ("body",)
    assert ask("C") == ["c,6"]
    assert ask("S") == ["s"]
    assert machine.board.leds.lit == ()
    assert ask("E") == ["e,0,0"]
    before = steps(machine)
    machine.run(cycles=FCY // 4)
    assert steps(machine) == before


WRONG = "D,1 D,1,2,3 D,1001,0 D,0,-1001 D,x,1 D,1, L,10,1 L,0,3 E,1 ! !65535,1 +300 + -64"


def test_commands_that_cannot_be_carried_out_are_answered_with_a_question_mark(talk) -> None:
    """A command with a wrong argument count, range or event is answered with a question mark and moves nothing.

    Source: bluetooth.h.
    """
    machine, ask = talk

    def check(line: str) -> None:
        before = steps(machine)
        assert ask(line) == ["?"]
        assert ask("E") == ["e,0,0"]
        assert steps(machine) == before

    check_all(check, WRONG.split())


def test_events_travel_both_ways(talk) -> None:
    """Events travel both ways over the text protocol: a received one is delivered as usual, a sent one is named."""
    machine, ask = talk
    left = EVENTS["left"]
    assert ask(f"+{left}", f"!{left},100") == ["+", "!", f"!{left},100"]
    assert ask("E") == ["e,775,0"]
    assert ask(f"!{left},-100") == ["!", f"!{left},65436"]
    machine.board.selector.position = 11
    machine.run(cycles=LINE_TIME)
    assert ask(f"+{EVENTS['selector']}") == ["+"]
    machine.board.selector.position = 12
    machine.run(cycles=LINE_TIME)
    assert ask("C") == ["c,12"], "the report came before the question"
    machine.board.selector.position = 13
    assert ask("", wait=2 * LINE_TIME) == [f"!{EVENTS['selector']},13"]
    assert ask(f"-{left}", f"!{left},0") == ["-", "!"]


def test_lines_no_command_matches_reach_the_application(talk) -> None:
    """A line that matches no command reaches the application as SYS_BLUETOOTH_RECEIVED (bluetooth.h).

    A thread of the self-test answers the lines N and A.
    """
    machine, ask = talk
    machine.board.ir.set_distance(2, 20)
    machine.run(cycles=FCY // 10)
    answer = ask("N", wait=FCY // 2)
    assert len(answer) == 8
    assert answer[2].startswith("proximity 2 85")
    assert ask("A", wait=FCY // 5) == ["acceleration 0 0 800", "sound 0 0 0"]
    assert ask("zzz") == []


def test_damaged_and_endless_lines_cost_only_themselves(talk) -> None:
    """Lines above 15 characters, framing errors and dropped characters cost only the affected line (bluetooth.h)."""
    machine, ask = talk
    assert ask("D,100,100" + "9" * 200, "V") == ["v,OpenSwarm"]
    assert ask("\n\r\n", "V") == ["v,OpenSwarm"]
    assert ask("E") == ["e,0,0"]
    for part, errors in ((b"L,5", 0), (b"0", FRAMING_ERROR), (b",1\r", 0)):
        machine.board.bluetooth.feed(part, errors=errors)
        machine.run(cycles=LINE_TIME)
    assert machine.board.leds.lit == ("led5",)
    machine.board.bluetooth.connected = False
    machine.board.bluetooth.feed(b"D,100,100\r")
    machine.run(cycles=LINE_TIME)
    machine.board.bluetooth.connected = True
    assert ask("E") == ["e,0,0"]
    assert machine.board.bluetooth.lost == 10


def test_led_orders_pass_the_processor(talk) -> None:
    """LED orders pass the processor: SYS_IO_LED carries [led, action], as text action * 256 + led (led.h)."""
    machine, ask = talk
    order = EVENTS["led"]
    assert ask(f"!{order},{1 << 8 | 4}") == ["!"]
    assert machine.board.leds.lit == ("led4",)
    assert ask(f"!{order},{1 << 8 | 0xFF}") == ["!"]
    assert len(machine.board.leds.lit) == 10
    assert ask(f"!{order},{2 << 8 | 0xFF}") == ["!"]
    assert machine.board.leds.lit == ()


def test_loudness_and_motion_come_as_events(talk) -> None:
    """Every 50 ms events report the peak amplitude of each microphone and the mean acceleration (analog.h)."""
    machine, ask = talk
    machine.board.microphones.play(0, lambda cycle: 300.0 if cycle // 40_000 % 2 else -310.0)
    machine.run(cycles=FCY // 10)
    assert f"!{EVENTS['sound']},310" in ask(f"+{EVENTS['sound']}", wait=FCY // 8)
    ask(f"-{EVENTS['sound']}")
    machine.board.accelerometer.set_g(0.5, 0.0, 0.9)
    machine.run(cycles=FCY // 10)
    assert f"!{EVENTS['motion']},400" in ask(f"+{EVENTS['motion']}", wait=FCY // 8)
