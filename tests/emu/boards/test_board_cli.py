"""`emu run` on the e-puck board, and `emu screenshot`."""

from __future__ import annotations

import json

import numpy as np
import pytest

from emu.boards.picture import read_picture, write_picture
from emu.cli import main


@pytest.fixture
def scene(tmp_path):
    """A picture file: left half red, right half green."""
    pixels = np.zeros((48, 64, 3), np.uint8)
    pixels[:, :32, 0] = 200
    pixels[:, 32:, 1] = 200
    path = tmp_path / "scene.png"
    write_picture(path, pixels)
    return str(path)


def test_run_gives_the_program_its_selector_and_camera(program, capsys):
    """`emu run` passes --selector and --sensor to the program, and the program's banner arrives through Bluetooth."""
    status = main(["run", str(program("startup.c")), "--selector", "7", "--seconds", "2", "--json"])
    facts = json.loads(capsys.readouterr().out)
    assert status == 0
    assert facts["reason"] == "halt"
    assert facts["uart1"].endswith('type "H" for help\r\n')


def test_watch_reports_the_robots_outputs(program, tmp_path, capsys):
    """`emu run --watch` reports LEDs, motors and UARTs with simulated time."""
    arguments = ["run", str(program("steps.c")), "--seconds", "0.35", "--watch", "motors,leds", "--engine", "plain"]
    assert main(arguments) == 0
    lines = [line.split("  ")[-1] for line in capsys.readouterr().err.splitlines()]
    assert "motors 101 -33 steps, 1000 -330 steps/s" in lines
    assert "motors 349 -116 steps in total" in lines


def test_stimulus_file_reaches_the_program(program, tmp_path, capsys):
    """A stimulus file feeds text to the program; a line break in the echo ends a line of --watch."""
    script = tmp_path / "events.txt"
    script.write_text('0.001s uart1 "hello\\n"\n0.01s battery 3.0\n')
    status = main(["run", str(program("serial.c")), "--seconds", "0.1", "--stimulus", str(script), "--watch", "uart1"])
    seen = capsys.readouterr()
    assert status == 0
    assert "uart1 'hello'" in seen.err


def test_screenshot_writes_what_the_driver_captured(program, scene, tmp_path, capsys):
    """`emu screenshot` writes the 20 x 20 pixels that the driver captured from the middle of the picture: left red,
    right green."""
    target = tmp_path / "frame.png"
    arguments = ["screenshot", str(program("camera.c", "lines.s")), "--camera", scene, "--seconds", "0.2", "-o"]
    arguments += [str(target), "--buffer", "frame", "--size", "20x20", "--enlarge", "3", "--json"]
    assert main(arguments) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["width"], facts["height"]) == (20, 20)
    pixels = read_picture(target)
    assert pixels.shape == (60, 60, 3)
    assert np.array_equal(np.unique(pixels[:, :30].reshape(-1, 3), axis=0), [[200, 0, 0]])
    assert np.array_equal(np.unique(pixels[:, 30:].reshape(-1, 3), axis=0), [[0, 200, 0]])


def test_screenshot_without_buffer_shows_what_the_sensor_sees(program, scene, tmp_path):
    """Without a buffer, `emu screenshot` shows the sensor's window: with the driver's registers 101 pixels wide and
    120 lines high."""
    target = tmp_path / "sensor.png"
    image = str(program("camera.c", "lines.s"))
    assert main(["screenshot", image, "--camera", scene, "--seconds", "0.2", "-o", str(target)]) == 0
    assert read_picture(target).shape == (120, 101, 3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "IMAGE", "--selector", "16"], "positions 0 to 15"),
        (["run", "IMAGE", "--board", "none", "--camera", "x.png"], "--camera needs a robot"),
        (["run", "IMAGE", "--sensor", "none", "--camera", "SCRIPT"], "--camera needs a sensor"),
        (["run", "IMAGE", "--camera", "SCRIPT"], "not a picture"),
        (["run", "IMAGE", "--camera", "absent.png"], "No such file"),
        (["run", "IMAGE", "--stimulus", "SCRIPT"], "events.txt:2: expected one of selector"),
        (["run", "IMAGE", "--watch", "smell"], "cannot watch 'smell'"),
        (["screenshot", "IMAGE", "--buffer", "frame"], "must be given together"),
        (["screenshot", "IMAGE", "--buffer", "nowhere", "--size", "2x2"], "no register or variable 'nowhere'"),
        (["screenshot", "IMAGE", "--buffer", "0x2700", "--size", "20x20"], "is outside RAM"),
        (["screenshot", "IMAGE", "--size", "20"], "WIDTHxHEIGHT"),
        (["screenshot", "IMAGE", "--seconds", "0"], "expected seconds above 0"),
        (["screenshot", "IMAGE", "--board", "none"], "no sensor"),
        (["screenshot", "IMAGE", "--buffer", "0x800", "--size", "3x1", "--format", "yuv"], "not a whole number"),
    ],
)
def test_bad_input_is_refused_in_one_line(program, tmp_path, capfd, arguments, message):
    """engines.md §10: invalid input ends with status 2 and a message without a traceback."""
    script = tmp_path / "events.txt"
    script.write_text("# nothing yet\n1s dance\n")
    names = {"IMAGE": str(program("startup.c")), "SCRIPT": str(script)}
    try:
        status = main([names.get(word, word) for word in arguments])
    except SystemExit as end:
        status = end.code
    err = capfd.readouterr().err
    assert status == 2
    assert message in err
    assert len(err.splitlines()) == 1
