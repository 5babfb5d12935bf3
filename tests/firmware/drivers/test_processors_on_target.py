"""Processors of all devices, exchanged while the devices run (openswarm_io.h)."""

from __future__ import annotations

import pytest

from emu.machine.machine import Machine
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.drivers.test_drivers_on_target import FCY, SCENES, plain, robot, steps

pytestmark = pytest.mark.slow

DEFAULTS, OWN, SWALLOW = 0, 1, 2
GREEN, CYAN, YELLOW, WHITE = 2, 3, 6, 7
LED_EVENT, LEFT_EVENT = 0x14, 2


@pytest.fixture
def machine(image: Build) -> Machine:
    made = robot(image("exchange", TARGET_APPS), selector=4)
    made.board.camera.show(plain(SCENES["robot"]))
    made.run(cycles=FCY // 2)
    assert made.peek("installed") == DEFAULTS
    return made


def choose(machine: Machine, which: int, seconds: float = 0.4) -> None:
    machine.poke("wanted", which)
    machine.run(cycles=FCY // 50)
    assert machine.peek("installed") == which
    machine.run(cycles=round(seconds * FCY))
    assert machine.peek("wrong") == 0


def say(machine: Machine, text: str) -> None:
    machine.board.bluetooth.feed(text.encode() + b"\r")
    machine.run(cycles=FCY // 20)


def test_input_devices_pass_what_their_processor_makes_of_it(machine: Machine) -> None:
    """Input devices deliver the result of their processor: the default, a replacement, and the default again.

    The devices are camera, proximity sensors, accelerometer and microphones.
    """
    for _ in range(2):
        choose(machine, DEFAULTS)
        assert machine.peek("colour") == GREEN
        assert machine.peek("nearest") == 255
        assert machine.peek("up") == 800
        assert machine.peek("loudness") == 0
        choose(machine, OWN)
        assert machine.peek("colour") == CYAN
        assert machine.peek("nearest") == 103
        assert machine.peek("up") == 0x10000 - 800
        assert machine.peek("loudness") == 64


def test_the_camera_processor_sees_the_whole_frame(machine: Machine) -> None:
    """The camera processor receives the whole 20 x 20 RGB565 frame and compares red with blue in its first pixel.

    Source: camera.h.
    """
    choose(machine, OWN)
    picture = plain((0, 0, 200))
    picture[:200, :300] = (200, 0, 0)
    machine.board.camera.show(picture)
    machine.run(cycles=FCY // 3)
    assert machine.peek("colour") == YELLOW


def test_remote_control_and_selector_pass_what_their_processor_makes_of_it(machine: Machine) -> None:
    """Processors of the remote control and the selector change or suppress events (remote.h, openswarm_io.h)."""
    for which, key, position in ((DEFAULTS, 12, 9), (OWN, 13, 6)):
        choose(machine, which, 0.1)
        machine.board.remote.press(12)
        machine.board.selector.position = 4
        machine.run(cycles=FCY // 10)
        machine.board.selector.position = 9
        machine.run(cycles=FCY // 5)
        assert (machine.peek("key"), machine.peek("position")) == (key, position)


def test_a_processor_may_swallow_everything(machine: Machine) -> None:
    """An event is suppressed if its processor returns false."""
    choose(machine, SWALLOW, 0.3)
    before = [machine.peek(name) for name in ("colours", "keys", "positions", "motions")]
    machine.board.remote.press(12)
    machine.board.selector.position = 1
    machine.run(cycles=FCY // 2)
    assert [machine.peek(name) for name in ("colours", "keys", "positions", "motions")] == before
    choose(machine, DEFAULTS, 0.5)
    assert machine.peek("colours") > before[0]


def test_output_devices_do_what_their_processor_says(machine: Machine) -> None:
    """Processors of output devices move LED orders to another LED, halve wheel speeds and refuse the drive command."""
    choose(machine, OWN, 0.1)
    machine.board.bluetooth.feed(b"x")
    say(machine, "")
    machine.run(cycles=FCY // 10)
    assert machine.peek("lines") == 1
    say(machine, "D,500,500")
    assert machine.peek("lines") == 1, "dealt with, not passed on"
    choose(machine, DEFAULTS, 0.1)
    say(machine, f"!{LED_EVENT},{1 << 8 | 2}")
    assert machine.board.leds.lit == ("led2",)
    say(machine, f"!{LEFT_EVENT},100")
    before = steps(machine)
    machine.run(cycles=FCY)
    made = [now - then for now, then in zip(steps(machine), before, strict=True)]
    assert made == pytest.approx([100 * 1000 / 129, 0], abs=1)
    choose(machine, SWALLOW, 0.1)
    assert machine.board.leds.lit == ("led2",)


def test_processors_change_under_load_without_harm(machine: Machine) -> None:
    """Processors are exchanged fifty times while frames, keys, scans and characters arrive; no event is lost."""
    machine.board.microphones.play(1, lambda cycle: 100.0 if cycle & 0x8000 else -100.0)
    for number in range(50):
        machine.poke("wanted", number % 3)
        machine.board.bluetooth.feed(b"E\rzz\r")
        machine.board.remote.press(number)
        assert machine.run(cycles=FCY // 40).reason == "limit"
    assert machine.peek("swaps") >= 49
    assert machine.peek("wrong") == 0
    choose(machine, DEFAULTS)
    assert machine.peek("loudness") == 100
    assert machine.peek("colour") == GREEN
