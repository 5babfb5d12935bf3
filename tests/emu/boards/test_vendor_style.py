"""Programs in the style of the vendor's library, on the whole robot (epuck.md §3, §6, §7).

Native code runs them; the last test compares its states with those of the interpreter.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from emu.api import Machine
from emu.boards.epuck.board import Epuck
from emu.image.loader import load_image

FCY = 14_745_600


@pytest.fixture
def start(program):
    """Return a function that starts a program: start("agenda.c", camera="PO3030K") returns a machine with it."""

    def load(source: str, engine: str = "auto", **options) -> Machine:
        image = load_image(program(source))
        machine = Machine(image.chip, engine=engine, board=partial(Epuck, **options))
        machine.load(image)
        return machine

    return load


def test_agenda_steps_both_motors_at_the_library_s_rates(start):
    """epuck.md §3: an agenda with a tick of 1,475 Tcy steps one motor every 20 and the other every 40 ticks: 500 and
    250 steps/s."""
    machine = start("agenda.c")
    machine.run(cycles=2 * FCY)
    ticks = 2 * FCY // 1475
    assert machine.peek("ticks") == pytest.approx(ticks, abs=2)
    motors = machine.board.motors
    assert motors.left.steps == pytest.approx(ticks // 20, abs=2)
    assert motors.right.steps == pytest.approx(-(ticks // 40), abs=2)
    assert (motors.left.lost, motors.left.illegal, motors.right.lost) == (0, 0, 0)


def test_remote_control_sampled_by_the_agenda_gives_the_keys_pressed(start):
    """epuck.md §6: the agenda, the periodic scheduler of the e-puck library, decodes pressed keys.

    It samples every 1.8 ms after the first edge, which INT0 detects.
    """
    machine = start("agenda.c")
    machine.run(cycles=FCY // 20)
    for number, key in enumerate((53, 12, 0, 63), start=1):
        machine.board.remote.press(key, address=5)
        machine.run(cycles=FCY // 8)
        assert (machine.peek("keys"), machine.peek("command"), machine.peek("address")) == (number, key, 5)
    assert machine.peek("noise") == 0


def test_codec_gets_its_settings_and_the_samples(start):
    """dspic30f6014a.md §14, epuck.md §6: the codec receives its control words in secondary frames, and samples with
    an interrupt every 4 frames of 2,048 Tcy."""
    machine = start("sound.c")
    heard: list[tuple[int, int]] = []
    machine.board.codec.on_sample = lambda sample, cycle: heard.append((sample, cycle))
    machine.run(cycles=FCY // 20)
    assert machine.peek("blocks") == pytest.approx(FCY / 20 / 8192, abs=2)
    registers = machine.board.codec.registers
    assert [registers[number] for number in (3, 4, 1, 2, 6, 7)] == [0x00, 0x13, 0x18, 0x00, 0xB3, 0x5F]
    assert max(sample for sample, _ in heard) >= 32_766
    gaps = {later - earlier for (_, earlier), (_, later) in zip(heard[-50:], heard[-49:], strict=False)}
    assert gaps == {2048}, "7,200 samples a second"


def test_serial_protocol_by_interrupt_answers_text_and_binary(start):
    """epuck.md §6: the serial protocol answers text commands and several binary commands in a row, ended by 0; RCON
    shows the RESET."""
    machine = start("sercom.c", selector=9)
    heard = bytearray()
    machine.uart[1].on_byte = lambda byte, _cycle: heard.append(byte)
    machine.run(cycles=FCY // 50)
    assert heard.endswith(b"e-Puck\r\n")

    def ask(data: bytes, wait: int = FCY // 50) -> bytes:
        heard.clear()
        machine.board.bluetooth.feed(data)
        machine.run(cycles=wait)
        return bytes(heard)

    def letter(text: str) -> int:
        return -ord(text) & 0xFF

    assert ask(b"C\r") == b"c,9\r\n"
    assert ask(b"V\r") == b"v,Version 1.02 test\r\n"
    drive = bytes([letter("D"), 0xF4, 0x01, 0x0C, 0xFE])
    assert ask(drive + bytes([letter("E"), letter("L"), 1, 2, letter("N"), 0])) == (
        bytes([0xF4, 0x01, 0x0C, 0xFE]) + b"".join((100 * i).to_bytes(2, "little") for i in range(8))
    )
    assert machine.board.leds.lit == ("led1",)
    assert ask(b"?") == b"z,Command not found\r\n"
    assert ask(b"R").startswith(b"r\r\n\f\aWELCOME")
    assert machine.peek("resets") & 0x40
    assert ask(b"abcdefgh" * 2, wait=FCY // 10).count(b"z,") == 16


def test_slow_camera_driver_captures_a_grey_picture(start):
    """epuck.md §7.3: the slow driver captures 40 x 40 of 320 x 320 grey pixels from a PO3030K with an interrupt every
    64 Tcy; the identity is 0x3030."""
    machine = start("slowcam.c", camera="PO3030K")
    y, x = np.mgrid[0:480, 0:640]
    picture = np.repeat(((x // 8 * 3 + y // 8 * 5) % 256).astype(np.uint8)[:, :, None], 3, axis=2)
    machine.board.camera.show(picture)
    assert machine.run(cycles=120_000_000).reason == "halt"
    assert machine.peek("id") == 0x3030
    at = machine.address_of("frame")
    frame = np.frombuffer(bytes(machine.record.bytes[at : at + 1600]), np.uint8).reshape(40, 40)
    steps = np.diff(frame.astype(np.int16), axis=1) % 256
    assert np.all(steps == 3), "every pixel is 8 columns from the one before"
    assert np.all(np.diff(frame.astype(np.int16), axis=0) % 256 == 5), "and 8 rows from the one above"


@pytest.mark.slow
@pytest.mark.parametrize("source", ["agenda.c", "sound.c", "sercom.c", "slowcam.c"])
def test_engines_agree_to_the_bit(start, source):
    """engines.md §4.3: after a frame of the remote control, both engines reach the same state at the same cycle."""
    states = []
    for engine in ("plain", "auto"):
        machine = start(source, engine, camera="PO3030K", seed=3)
        machine.board.remote.press(7)
        machine.board.bluetooth.feed(b"C\rV\rxyz")
        machine.run_until(444_444)
        states.append((machine.cycle, machine.record.field_at, machine.snapshot()))
    (cycle, name, one), (other_cycle, _, two) = states
    assert cycle == other_cycle
    assert [name(place) for place in range(len(one)) if one[place] != two[place]] == []
