"""Pictures of the camera (epuck.md §7): formats, exposure, mirrors, and the sources of its pixels."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

from emu.boards.epuck.camera.pixels import Gains, decode, encode

from ..conftest import Robot
from .camera_driver import capture, po3030, po6030, rgb565, scene


def test_mirrors_turn_the_picture():
    """§7.1: PO6030K is mounted upside down, so without the mirror bits the picture is turned by 180 degrees."""
    robot = Robot()
    picture = scene()
    robot.board.camera.show(picture)
    robot.configure([*po6030(), (0, 0x90, 0x00)])
    data = capture(robot, 2, 8).reshape(2, 4, 2)
    rows, columns = 479 - (160 + 4 * np.arange(2)), 639 - (240 + 4 * np.arange(4))
    assert np.array_equal(data, rgb565(picture[rows][:, columns]))


@pytest.mark.parametrize(("mirrors", "turned"), [(0x00, {"PO6030K"}), (0xC0, {"PO8030D"})])
def test_equal_mirrors_turn_the_pictures_of_the_two_banked_sensors_against_each_other(mirrors, turned):
    """§7.1: with both mirrors for PO6030K and none for PO8030D, as the library sets them, both pictures are upright."""
    picture = np.zeros((480, 640, 3), np.uint8)
    picture[:240, :320, 0] = 255
    for sensor, register in (("PO6030K", 0x90), ("PO8030D", 0x6C)):
        robot = Robot(camera=sensor)
        robot.board.camera.show(picture)
        robot.configure([(1, 0x38 if sensor == "PO6030K" else 0x4E, 0x08 if sensor == "PO6030K" else 0x30),
                         (0, register, mirrors)])  # fmt: skip
        red = robot.board.camera.frame()[:, :, 0] > 128
        corner = red[-1, -1] if sensor in turned else red[0, 0]
        assert corner
        assert red[0, 0] + red[0, -1] + red[-1, 0] + red[-1, -1] == 1


def test_yuv_and_grey_follow_bt601():
    """§7.4: YUV pixels are U Y V Y by BT.601, and grey is Y."""
    robot = Robot()
    robot.board.camera.show(np.full((480, 640, 3), (200, 100, 50), np.uint8))
    robot.configure(po6030(form="yuv"))
    luma = (77 * 200 + 150 * 100 + 29 * 50 + 128) >> 8
    data = capture(robot, 1, 8)[0]
    assert list(data[1::2]) == [luma] * 4
    assert data[0] != data[2]
    robot = Robot()
    robot.board.camera.show(np.full((480, 640, 3), (200, 100, 50), np.uint8))
    robot.configure(po6030(form="grey"))
    assert set(capture(robot, 1, 8)[0]) == {luma}


def test_gain_and_exposure_registers_scale_the_picture():
    """§7.2, §7.6: with automatic control off, gain (0x40 = 1.0) and exposure scale the picture."""
    robot = Robot()
    robot.board.camera.show(np.full((480, 640, 3), 64, np.uint8))
    off = (2, 0x04, 0x98 | 5)
    robot.configure([*po6030(), off, (2, 0xA4, 0x80), (2, 0xA5, 0x40), (2, 0xA6, 0x20)])
    assert list(capture(robot, 1, 2)[0]) == list(rgb565(np.array([128, 64, 32])))
    robot.configure([(2, 0x2D, 0x10)])  # doubles the exposure
    assert list(capture(robot, 1, 2)[0]) == list(rgb565(np.array([255, 128, 64])))


def test_pictures_of_any_size_are_scaled_and_bad_shapes_refused(robot):
    """Grey, RGB and RGBA pictures of any size are scaled to the sensor, and arrays of other shapes are refused."""
    robot.board.camera.show(np.zeros((3, 4), np.uint8))
    robot.board.camera.show(np.zeros((30, 40, 4), np.uint8))
    with pytest.raises(ValueError, match="picture is height x width"):
        robot.board.camera.show(np.zeros((3, 4, 2), np.uint8))
    with pytest.raises(ValueError, match="no sensor"):
        Robot(camera="OV7670")


def grey_level(robot):
    return int(capture(robot, 1, 2)[0][0])


def test_automatic_exposure_follows_the_lamp_in_ten_frames(robot):
    """§7.6: automatic exposure converges in 5 to 10 frames after a change of the lamp."""
    camera = robot.board.camera
    camera.show(np.full((48, 64), 120, np.uint8))
    robot.configure(po6030(form="grey"))
    frame = camera.scan.timing.frame_tcy
    assert grey_level(robot) == 120
    camera.lamp = 0.5
    levels = []
    for _ in range(10):
        levels.append(grey_level(robot))
    assert levels == sorted(levels)
    assert levels[0] < 100
    assert grey_level(robot) == pytest.approx(120, abs=1)
    robot.later(20 * frame)
    assert grey_level(robot) == 120


def test_without_automatic_exposure_the_lamp_shows(robot):
    """§7.6: without automatic exposure, the lamp changes the picture's brightness."""
    robot.board.camera.show(np.full((48, 64), 120, np.uint8))
    robot.configure([*po6030(form="grey"), (2, 0x04, 0x99)])
    robot.board.camera.lamp = 0.5
    robot.later(40_000_000)
    assert grey_level(robot) == 60


def test_po3030k_manual_exposure_and_gain():
    """§7.2: D4 = 0x0C turns automatic exposure and gain off. Register B0 is the exposure, 15 the global gain (0x10 =
    1) and 16 the red gain (0x40 = 1)."""
    robot = Robot(camera="PO3030K")
    robot.board.camera.show(np.full((480, 640, 3), 64, np.uint8))
    robot.configure([*po3030(), (0, 0xD4, 0x0C), (0, 0x15, 0x20), (0, 0x16, 0x60)])
    assert list(capture(robot, 1, 2)[0]) == list(rgb565(np.array([192, 128, 128])))


def test_pixel_sources_are_called_for_read_lines_only(robot):
    """The pixel source is called with the window's columns, only for lines that are read."""
    asked = []

    def pixels(y, columns, cycle):
        asked.append((y, columns.tolist(), cycle))
        return np.zeros((len(columns), 3), np.uint8)

    robot.board.camera.show_pixels(pixels)
    robot.configure(po6030())
    robot.later(5_000_000)
    assert asked == []
    capture(robot, 2, 4, skip_lines=1)
    assert [y for y, _, _ in asked] == [160, 168]
    assert asked[0][1] == list(range(236, 640, 4))
    assert asked[0][2] == robot.board.camera.scan.href(40, 3)


def test_a_look_at_the_pixel_bus_asks_no_source_and_changes_nothing(robot):
    """A tool's read of the pixel bus calls no pixel source, whose random numbers would change the rest of the trial."""
    asked = []

    def pixels(y, columns, cycle):
        asked.append(y)
        return np.full((len(columns), 3), 255, np.uint8)

    machine, camera = robot.machine, robot.board.camera
    robot.configure(po6030())
    camera.show_pixels(pixels)
    machine.state.cycle = camera.scan.href(60, 1) + 5
    robot.at(machine.cycle)
    before = machine.snapshot()
    assert machine.peek("PORTD") >> 8 == machine.pins.get("RD15") == 0
    assert (asked, machine.snapshot()) == ([], before)
    line = robot.read("PORTD") >> 8
    assert (len(asked), machine.peek("PORTD") >> 8, line != 0) == (1, line, True)


def test_a_look_at_the_pixel_bus_sees_a_still_picture(robot):
    """A tool's read of a still picture, which has no state, returns the byte that an instruction would read."""
    robot.configure(po6030())
    robot.board.camera.show(scene())
    robot.at(robot.board.camera.scan.href(60, 1) + 5)
    seen = robot.machine.peek("PORTD") >> 8
    assert seen == robot.read("PORTD") >> 8 != 0


def test_frame_is_the_picture_the_sensor_sends(robot):
    """`frame` returns the picture as on the bus, with window, format and gains."""
    picture = scene()
    robot.board.camera.show(picture)
    robot.configure(po6030())
    frame = robot.board.camera.frame()
    assert frame.shape == (120, 101, 3)
    assert np.array_equal(frame[38], picture[152, 236::4] & [0xF8, 0xFC, 0xF8])


@pytest.mark.parametrize(("sensor", "writes"), [("PO6030K", po6030(form="yuv")), ("PO3030K", po3030(236, form="yuv"))])
def test_a_line_of_an_odd_number_of_pixels_in_yuv_is_shown_whole(sensor, writes):
    """§7.4: in a line with an odd number of pixels, the last pixel's luma and blue difference are sent without a
    partner."""
    robot = Robot(camera=sensor)
    robot.board.camera.show(np.repeat(scene()[:, :, :1], 3, axis=2))
    robot.configure(writes)
    frame, readout = robot.board.camera.frame(), robot.board.camera._readout
    assert frame.shape[1] % 2
    grey = scene()[:, :, 0][np.ix_(readout._rows, readout._columns)].astype(int)
    assert np.abs(frame - grey[:, :, None]).max() <= 4


@pytest.mark.parametrize("form", ["rgb565", "grey", "yuv"])
def test_decoding_gives_back_what_the_format_keeps(form):
    """Decoding restores grey scales within the precision of every format, and colours with RGB565 and, within 3, with
    YUV."""
    grey = np.repeat(np.arange(0, 256, 8, dtype=np.uint8)[:, None], 3, axis=1)

    def there_and_back(pixels):
        room = (ctypes.c_uint8 * 256)()
        count = encode(pixels.ctypes.data, len(pixels), form, Gains(1.0, 1.0, 1.0), ctypes.addressof(room))
        return decode(bytes(room[:count]), form).astype(int)

    assert np.abs(there_and_back(grey) - grey).max() <= 4
    if form != "grey":
        red = np.tile(np.array([200, 96, 40], np.uint8), (4, 1))
        assert np.abs(there_and_back(red) - red).max() <= 4


def test_a_source_with_a_wrong_number_of_pixels_is_refused(robot):
    """A pixel source that returns a wrong number of pixels is refused, and the record is unchanged."""
    robot.configure(po6030())
    robot.board.camera.show_pixels(lambda _y, columns, _cycle: np.zeros((len(columns) + 1, 3), np.uint8))
    with pytest.raises(ValueError, match="expected 101 pixels"):
        robot.board.camera.frame()


def test_turned_sensors_see_a_turned_picture(robot):
    """§7.1: the array of PO3030K robots is mounted turned by 90 degrees, and so is their picture."""
    marked = np.zeros((64, 48), np.uint8)
    marked[0, 0] = 255  # top left pixel of an upright picture
    robot.board.camera.show(marked, turned=90)
    robot.configure([(1, 0x80, 0x20), (0, 0x90, 0xC0), (1, 0x38, 0x0D)])
    frame = robot.board.camera.frame()
    assert frame[-1, 0].tolist() == [255] * 3
    assert frame[0, 0].tolist() == [0] * 3
    with pytest.raises(ValueError, match="turned by"):
        robot.board.camera.show(marked, turned=45)


def test_the_old_spelling_of_show_pixels_warns(robot: Robot) -> None:
    """`Camera.sample` of release 0.2 sets the scene and names the new spelling."""

    def pixels(_y: int, columns: Any, _cycle: int) -> Any:
        return np.zeros((len(columns), 3), np.uint8)

    with pytest.warns(DeprecationWarning, match="show_pixels"):
        robot.board.camera.sample(pixels)
    assert robot.board.camera.pixel_source is pixels
