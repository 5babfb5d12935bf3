"""External faults on a running robot: no call hangs, and the report names the faulty device."""

from __future__ import annotations

import random

import numpy as np
import pytest

from emu.boards.epuck.stimulus import parse
from emu.machine.machine import Machine
from emu.peripherals.uart.rx_queue import BREAK, FRAMING_ERROR
from tests.cases import check_all
from tests.firmware.conftest import Build
from tests.firmware.drivers.test_drivers_on_target import (
    FCY,
    SCENES,
    START,
    captured,
    noise,
    plain,
    robot,
    steps,
    window,
)
from tests.fuzz.seeds import base_seed

FRAME_TCY = 1_600_000


def listen(machine: Machine) -> bytearray:
    heard = bytearray()
    machine.uart[1].on_byte = lambda byte, _cycle: heard.append(byte)
    return heard


def self_test_report(machine: Machine, heard: bytearray, seconds: float = 4.0) -> bytes:
    """Return the self-test's report; the test fails if the report does not end."""
    end = machine.cycle + round(seconds * FCY)
    while b"end\r\n" not in heard:
        assert machine.cycle < end, bytes(heard)
        assert machine.run(cycles=FCY // 20).reason == "limit"
    machine.run(cycles=FCY // 20)  # the self-test's thread now waits for questions
    return bytes(heard)


# -- camera ------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_camera_pulled_out_while_it_is_programmed_costs_only_the_camera(image: Build) -> None:
    """Unplugging the camera while it is programmed (no slave acknowledges) costs only the camera (epuck.md §7.1).

    Programming takes about 8 ms after start-up. A camera unplugged later is one that sends no frames. The commit
    determines which instants are tried.
    """

    def check(microseconds: int) -> None:
        machine = robot(image("selftest"))
        heard = listen(machine)
        machine.board.stimulus.play(parse(machine.board, f"{microseconds}us camera unplug"))
        report = self_test_report(machine, heard)
        assert b"i2c 2 0 0 FAIL" in report  # I2C_NO_ACK
        assert b"motors done" in report
        assert steps(machine) == pytest.approx((1000, 1000), abs=2)

    check_all(check, [10, *random.Random(base_seed()).sample(range(20, 8000), 2)])


@pytest.mark.parametrize("line", range(0, 40, 7))
def test_a_camera_pulled_out_in_the_middle_of_a_frame_stops_only_its_frames(image: Build, line: int) -> None:
    """If HREF stops within a frame, the capture waits, everything else continues, and the wheels keep their speed."""
    machine = robot(image("clustering"), selector=START)
    camera = machine.board.camera
    camera.show(plain(SCENES["object"]))
    machine.run(cycles=FCY // 2)
    camera.align(machine.cycle + 50_000, line)
    machine.run(cycles=50_300)  # in the middle of that line
    camera.unplug()
    machine.run(cycles=FCY // 10)
    before, frames = steps(machine), machine.peek("frames")
    machine.run(cycles=FCY // 2)
    assert machine.peek("frames") - frames <= 0
    moved = [now - then for now, then in zip(steps(machine), before, strict=True)]
    assert moved == pytest.approx([129 * 500 / 129, 64 * 500 / 129], abs=2)  # object: 129 and 64 mm/s
    machine.board.remote.press("standby")
    machine.run(cycles=FCY // 5)
    before = steps(machine)
    machine.run(cycles=FCY // 5)
    assert steps(machine) == before


def test_a_camera_that_loses_contact_for_a_moment_spoils_one_frame(image: Build) -> None:
    """Missing lines spoil one frame only.

    The capture takes the missing lines from the next frame, so that one frame is a mixture; the following frames are
    correct.
    """
    machine = robot(image("clustering"), selector=START)
    camera = machine.board.camera
    camera.show(noise())
    machine.run(cycles=FCY // 2)
    camera.align(machine.cycle + 50_000, line=60)
    camera.align(machine.cycle + 700_000, line=3)  # the sensor restarts: lines 60 to 119 are missing
    machine.run(cycles=5 * FRAME_TCY)
    assert np.array_equal(captured(machine), window(noise()))


# -- battery -----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("volts", "word"), [(3.39, b"battery low"), (3.4, b"battery ok")])
def test_a_low_battery_is_reported(image: Build, volts: float, word: bytes) -> None:
    """A battery below 3.4 V, which clears RF1, is reported (epuck.md §2)."""
    machine = robot(image("selftest"))
    heard = listen(machine)
    machine.board.battery.volts = volts
    machine.run(cycles=FCY // 5)
    assert word in heard


# -- UART --------------------------------------------------------------------------------------------------------------


def uart_counts(machine: Machine, heard: bytearray) -> tuple[int, int, int]:
    """Return UART1's counts of refused, lost and damaged messages."""
    heard.clear()
    machine.board.bluetooth.feed(b"\rU\r")
    machine.run(cycles=FCY // 10)
    words = heard.split(b"uart ")[1].split(b"\r")[0].split()
    return int(words[0]), int(words[1]), int(words[2])


def test_framing_errors_and_breaks_are_counted_and_the_next_line_is_right(image: Build) -> None:
    """Framing errors and breaks are counted, and the next line is received correctly (dspic30f6014a.md §10.2).

    FERR is set with its character; a break is the character 0 with FERR.
    """
    machine = robot(image("selftest"))
    heard = listen(machine)
    self_test_report(machine, heard)
    assert uart_counts(machine, heard) == (0, 0, 0)
    for errors in (FRAMING_ERROR, FRAMING_ERROR, BREAK):
        machine.board.bluetooth.feed(b"x", errors=errors)
    machine.run(cycles=FCY // 50)
    assert uart_counts(machine, heard) == (0, 3, 0)
    machine.board.bluetooth.feed(b"C\r")
    heard.clear()
    machine.run(cycles=FCY // 50)
    assert heard == b"c,0\r\n"


def test_an_overrun_is_counted_and_reception_goes_on(image: Build) -> None:
    """An overrun is counted and reception continues (dspic30f6014a.md §10.2).

    The fifth character in a full FIFO of four sets OERR; clearing OERR empties the FIFO.
    """
    machine = robot(image("selftest"))
    heard = listen(machine)
    self_test_report(machine, heard)
    enabled = machine.peek("IEC0")
    machine.write("IEC0", enabled & ~(1 << 9))  # disables the receive interrupt: the characters stay in the FIFO
    machine.board.bluetooth.feed(b"D,1000,1000\r")
    machine.run(cycles=FCY // 50)
    assert machine.peek("U1STA") & 1 << 1
    machine.write("IEC0", machine.peek("IEC0") | 1 << 9)
    machine.run(cycles=FCY // 50)
    assert not machine.peek("U1STA") & 1 << 1
    lost = uart_counts(machine, heard)[1]
    assert 1 <= lost <= 2
    before = steps(machine)
    machine.run(cycles=FCY // 10)
    assert steps(machine) == before, "half a command moves nothing"


def test_every_device_failing_at_once_ends_in_a_report(image: Build) -> None:
    """With all devices failing the self-test still ends with a report.

    The faults are a missing camera, a bus held low, an empty battery and endless breaks on the radio.
    """
    machine = robot(image("selftest"), camera=None)
    heard = listen(machine)
    machine.peripherals.i2c.wire.hold(sda=True, scl=True)
    machine.board.battery.volts = 3.0
    for tenth in range(30):
        machine.board.bluetooth.feed(b"\0", cycle=tenth * FCY // 10, errors=BREAK)
    report = self_test_report(machine, heard)
    assert b"camera 0000 FAIL" in report
    assert b"i2c 5 0 0 FAIL" in report  # I2C_STUCK
    assert b"battery low" in report
    assert b"motors done" in report
