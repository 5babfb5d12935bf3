"""The camera (epuck.md §7). A driver in Python reads the bus in the cycles in which the library's handler does."""

from __future__ import annotations

import ctypes
import random
from typing import Any

import numpy as np
import pytest

from emu.boards.epuck.camera.pixels import Gains, decode, encode
from emu.boards.epuck.camera.scan import HREF, PCLK, VSYNC, per_frame
from emu.boards.epuck.camera.sensors import SENSORS
from emu.peripherals.timers.rules import write_ton

from ..conftest import Robot

FCY = 14_745_600
FIRST_READ = 17
"""Tcy from an HREF edge to the first read of PORTD in the library's handler, which are 16 to 18 (§7.5)."""


def po6030(x=240, y=160, scale=4, form="rgb565"):
    """Return the register writes of the fast driver for PO6030K (openswarm-original.md §5.5)."""
    speed = {("grey", 1): 0x90, ("grey", 2): 0x50, ("grey", 4): 0x10, 1: 0xB0, 2: 0x90, 4: 0x50}
    start = (x + 16 - scale) // scale - 1
    row = y + 8 - scale
    return [
        (1, 0x51, start & 0xFF), (1, 0x50, start >> 8), (1, 0x60, row >> 8), (1, 0x61, row & 0xFF),
        (1, 0x62, 488 >> 8), (1, 0x63, 488 & 0xFF), (0, 0x91, speed[("grey", scale) if form == "grey" else scale]),
        (1, 0x38, {"rgb565": 0x08, "grey": 0x0D, "yuv": 0x02}[form]), (1, 0x80, 0x20 * scale),
        (1, 0x81, 0x20 * scale), (1, 0x82, 1), (0, 0x90, 0xC0),
    ]  # fmt: skip


def po3030(x=240, y=160, scale=4, form="rgb565"):
    """Return the register writes of the fast driver for PO3030K (§7.5)."""
    bytes_per_pixel = 1 if form == "grey" else 2
    divider = {2: 0, 4: 2, 8: 3, 16: 4}[8 * bytes_per_pixel // scale]
    x1, y1 = x + 210 - scale - 1, y + 7 - scale
    words = {0x08: x1, 0x0A: y1, 0x0C: 851, 0x0E: 488, 0xA5: y1, 0xA7: 487, 0xA9: x1 + 2}
    writes = [(0, reg + i, byte) for reg, word in words.items() for i, byte in enumerate(divmod(word, 256))]
    writes.append((0, 0x4E, {"rgb565": 0x08, "grey": 0x0C, "yuv": 0x02}[form]))
    writes.append((0, 0x1D, divider << 4))
    writes.append((0, 0x20, {1: 0x44, 2: 0x11, 4: 0x33}[scale]))
    return writes


def scene():
    """Return a picture whose pixels encode their own position within the precision of RGB565."""
    y, x = np.mgrid[0:480, 0:640]
    return np.stack([(x // 3) & 0xF8, (y // 2) & 0xFC, (x * 7 + y * 13) & 0xF8], axis=2).astype(np.uint8)


def capture(robot, lines, bytes_per_line, skip_lines=0):
    """Capture a frame: T5 counts VSYNC, T4 counts HREF, and PORTD is read every 8 Tcy from 17 Tcy after the HREF
    edge."""
    camera = robot.board.camera
    robot.write_all(TMR5=0, PR5=1, TMR4=skip_lines, PR4=skip_lines + 1, T5CON=0x8002, IFS1=0)
    while not robot.read("IFS1") & 1 << 6:
        robot.at(robot.machine.peripherals.context.bus.events.next_due())
    robot.write_all(T5CON=0, T4CON=0x8002)
    rows = []
    for _ in range(lines):
        robot.write("IFS1", 0)
        while not robot.read("IFS1") & 1 << 5:
            robot.at(robot.events.next_due())
        robot.write("TMR4", 0)
        edge = robot.events.now - 2  # an edge in cycle c raises the flag in c + 2
        assert camera.scan.bits(edge) & HREF
        assert not camera.scan.bits(edge - 1) & HREF
        data = []
        for index in range(bytes_per_line):
            robot.at(edge + FIRST_READ + 8 * index)
            data.append(robot.read("PORTD") >> 8)
        rows.append(data)
    robot.write("T4CON", 0)
    return np.array(rows, dtype=np.uint8)


def rgb565(pixels):
    red, green, blue = (pixels[..., channel].astype(int) for channel in range(3))
    words = (red >> 3) << 11 | (green >> 2) << 5 | blue >> 3
    return np.stack([words >> 8, words & 0xFF], axis=-1)


def test_openswarm_window_is_captured_pixel_by_pixel():
    """§7.5: for a window of 160 x 160, centred, with zoom 8, the sensor sends QQVGA, and software takes every second
    pixel and line."""
    robot = Robot()
    picture = scene()
    robot.board.camera.show(picture)
    robot.configure(po6030())
    data = capture(robot, 20, 2 * 40, skip_lines=1)
    pixels = data.reshape(20, 40, 2)[:, ::2]
    assert np.array_equal(pixels, rgb565(picture[160:320:8, 240:400:8]))


@pytest.mark.parametrize(("scale", "shift"), [(1, -1), (2, -1), (4, -1)])
def test_po3030k_rgb_window_begins_one_column_early(scale, shift):
    """§7.5: in every RGB mode of the PO3030K, the first stored pixel is that of column x - 1."""
    robot = Robot(camera="PO3030K")
    picture = scene()
    robot.board.camera.show(picture)
    robot.configure(po3030(scale=scale))
    data = capture(robot, 3, 2 * 10).reshape(3, 10, 2)
    columns = 240 + shift + scale * np.arange(10)
    rows = 160 + scale * np.arange(3)
    assert np.array_equal(data, rgb565(picture[rows][:, columns]))


@pytest.mark.parametrize(("scale", "shift"), [(1, 0), (2, 1), (4, 3)])
def test_po3030k_grey_window(scale, shift):
    """§7.5: grey windows of the PO3030K start at column x for VGA, x + 1 for QVGA and x + 3 for QQVGA."""
    robot = Robot(camera="PO3030K")
    ramp = np.tile((np.arange(640) // 4).astype(np.uint8) + 40, (480, 1))
    ramp[:, ::4] += 90
    robot.board.camera.show(ramp)
    robot.configure(po3030(scale=scale, form="grey"))
    data = capture(robot, 2, 12)
    assert np.array_equal(data[0], ramp[160, 240 + shift + scale * np.arange(12)])


@pytest.mark.parametrize(
    ("sensor", "writes", "frame", "fps"),
    [
        ("PO6030K", po6030(), 1_600_000, 9.216), ("PO6030K", po6030(form="grey"), 800_000, 18.432),
        ("PO6030K", po6030(scale=1), 6_400_000, 2.304), ("PO3030K", po3030(), 3_408_000, 4.33),
        ("PO3030K", po3030(form="grey"), 1_704_000, 8.65), ("PO3030K", po3030(scale=2), 6_816_000, 2.16),
        ("PO3030K", po3030(scale=1), 13_632_000, 1.08),
    ],
)  # fmt: skip
def test_frame_rates(sensor, writes, frame, fps):
    """§7.4, §7.1: a frame lasts 800 x 500 or 852 x 1000 columns of N Tcy."""
    robot = Robot(camera=sensor)
    robot.configure(writes)
    assert robot.board.camera.scan.timing.frame_tcy == frame
    assert robot.board.camera.frames_per_second == pytest.approx(fps, rel=2e-3)


@pytest.mark.parametrize(("scale", "form", "line"), [(4, "rgb565", 13632), (1, "rgb565", 13632), (2, "grey", 6816)])
def test_line_spacing_of_the_fast_driver_is_the_same_in_every_mode(scale, form, line):
    """§7.4: lines of the fast driver are 6816 Tcy apart for grey and 13632 for RGB, with one byte every 8 Tcy."""
    robot = Robot(camera="PO3030K")
    robot.configure(po3030(scale=scale, form=form))
    camera = robot.board.camera
    assert camera.scan.href(1) - camera.scan.href(0) == line
    assert camera.scan.timing.byte_tcy == 8


def test_short_exposure_shortens_the_frame_of_the_po3030k():
    """§7.4: a frame of the PO3030K has max(852, integration + 2) rows."""
    robot = Robot(camera="PO3030K")
    robot.configure([*po3030(), (0, 0x1A, 0x01), (0, 0x1B, 0x00)])
    assert robot.board.camera.scan.timing.frame_tcy == 852 * 852 * 4


def test_vsync_rises_two_columns_behind_href_of_its_row():
    """§7.4: VSYNC rises two columns (2 N Tcy) after HREF of its row, so the handler takes the next line."""
    robot = Robot(camera="PO3030K")
    robot.configure(po3030())
    camera = robot.board.camera
    rise = camera.scan.edge_cycle(VSYNC, 1)
    assert rise - camera.scan.href(0) == 8
    assert camera.scan.bits(rise) & VSYNC
    assert not camera.scan.bits(rise - 1) & VSYNC


@pytest.mark.parametrize("sensor", sorted(SENSORS))
@pytest.mark.parametrize("mask", [HREF, VSYNC, PCLK])
def test_edge_arithmetic_agrees_with_the_levels(sensor, mask):
    """Closed forms of the signal edges equal the levels stepped cycle by cycle, around the ends of lines and frames."""
    robot = Robot(camera=sensor)
    robot.configure({"PO3030K": [], "PO6030K": [(0, 0x91, 0x90)], "PO8030D": [(0, 0x6A, 0x04)]}[sensor])
    camera = robot.board.camera
    number, checked = 1, 0
    while checked < 60:
        cycle = camera.scan.edge_cycle(mask, number)
        assert camera.scan.bits(cycle) & mask
        assert not camera.scan.bits(cycle - 1) & mask
        assert (camera.scan.edges(mask, cycle - 1), camera.scan.edges(mask, cycle)) == (number - 1, number)
        number += 1 if checked % 3 else max(per_frame(mask, camera.scan.timing) * 3 // 10, 1)
        checked += 1


def test_byte_stands_on_the_bus_from_half_a_byte_before_to_half_behind():
    """§7.5: byte k is on the bus for HREF + 8 k - 4 <= t < HREF + 8 k + 4."""
    robot = Robot()
    robot.board.camera.show(np.full((480, 640, 3), 255, np.uint8))
    robot.configure(po6030())
    camera = robot.board.camera
    edge = camera.scan.href(30)
    assert [camera.bits(edge + t) >> 8 for t in (-5, -4, 3)] == [0, 255, 255]
    last = edge + 8 * camera.scan.timing.line_bytes - 4
    assert [camera.bits(t) >> 8 for t in (last - 1, last)] == [255, 0]


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


@pytest.mark.parametrize(("sensor", "identity"), [("PO3030K", 0x3030), ("PO6030K", 0x6030), ("PO8030D", 0x8030)])
def test_identity_over_i2c(sensor, identity):
    """§7.1: the I2C module reads the identity from registers 0 and 1 at 0xDC/0xDD."""
    robot = Robot(camera=sensor)
    robot.write_all(I2CBRG=150, I2CCON=0x9000)

    def operation(name, value):
        robot.write("IFS0", 0)
        robot.write(name, value)
        while not robot.read("IFS0") & 1 << 14:
            robot.later(50)

    def register(number):
        operation("I2CCON", 0x9001)
        operation("I2CTRN", 0xDC)
        operation("I2CTRN", number)
        operation("I2CCON", 0x9002)
        operation("I2CTRN", 0xDD)
        assert not robot.read("I2CSTAT") & 0x8000
        operation("I2CCON", 0x9008)
        value = robot.read("I2CRCV")
        operation("I2CCON", 0x9030)
        operation("I2CCON", 0x9004)
        return value

    assert register(0) << 8 | register(1) == identity


def test_reset_line_stops_the_sensor_and_clears_its_registers(robot):
    """§2: RC13 = 0 stops the sensor and clears its registers."""
    robot.configure([(1, 0x80, 0x80)])
    robot.output("RC13", 0)
    camera = robot.board.camera
    assert not camera.start(False, 10)
    assert camera.scan.edge_cycle(HREF, 1) > 1 << 60
    robot.at(1000).output("RC13", 1)
    assert camera.register(1, 0x80) == 0x20
    assert camera.start(False, 1010)
    assert camera.scan.href(0) > 1000


def test_unplugged_camera_gives_neither_answers_nor_edges(robot):
    """An unplugged camera does not answer at address 0x6E and has no VSYNC edges."""
    robot.write_all(PR5=1, T5CON=0x8002)
    robot.board.camera.unplug()
    robot.at(20_000_000)
    assert not robot.read("IFS1") & 1 << 6
    assert 0x6E not in robot.board.chip.i2c.wire.devices
    robot.board.camera.plug()
    robot.at(40_000_000)
    assert robot.read("IFS1") & 1 << 6


def test_lines_of_a_moving_scene_are_seen_when_they_are_read_out(robot):
    """The pixel source receives the cycle of each line, so that a moving scene shows the rolling shutter."""
    seen = []

    def rows(y, cycle):
        seen.append((y, cycle))
        return np.zeros((640, 3), np.uint8)

    robot.board.camera.show_rows(rows)
    robot.configure(po6030())
    capture(robot, 3, 4)
    line = 800 * 4 * 4
    assert [y for y, _ in seen] == [160, 164, 168]
    assert [later - seen[0][1] for _, later in seen] == [0, line, 2 * line]


def test_snapshot_restores_registers_and_timing(robot):
    """A restored snapshot has the camera's registers and timing; derived state is computed again."""
    robot.configure(po6030())
    state = robot.machine.snapshot()
    frame = robot.board.camera.scan.timing.frame_tcy
    robot.configure([(1, 0x80, 0x20), (0, 0x91, 0xB0)])
    assert robot.board.camera.scan.timing.frame_tcy != frame
    robot.machine.restore(state)
    assert robot.board.camera.scan.timing.frame_tcy == frame


def test_pictures_of_any_size_are_scaled_and_bad_shapes_refused(robot):
    """Grey, RGB and RGBA pictures of any size are scaled to the sensor, and arrays of other shapes are refused."""
    robot.board.camera.show(np.zeros((3, 4), np.uint8))
    robot.board.camera.show(np.zeros((30, 40, 4), np.uint8))
    with pytest.raises(ValueError, match="picture is height x width"):
        robot.board.camera.show(np.zeros((3, 4, 2), np.uint8))
    with pytest.raises(ValueError, match="no sensor"):
        Robot(camera="OV7670")


def test_po8030d_delivers_the_openswarm_window():
    """openswarm-original.md §5.5: the PO8030D delivers the window of 160 x 160, centred, with zoom 8."""
    robot = Robot(camera="PO8030D")
    picture = scene()
    robot.board.camera.show(picture)
    window = {0x08: 0x00, 0x09: 0x3B, 0x10: 0x00, 0x11: 0xA0, 0x12: 0x01, 0x13: 0xE4, 0x6A: 0x02, 0x6C: 0x00}
    mode = {0x4E: 0x30, 0xB7: 3, 0x93: 0x80, 0x94: 0x80}
    robot.configure([*((0, reg, value) for reg, value in window.items()), *((1, r, v) for r, v in mode.items())])
    pixels = capture(robot, 20, 2 * 40, skip_lines=1).reshape(20, 40, 2)[:, ::2]
    assert np.array_equal(pixels, rgb565(picture[160:320:8, 240:400:8]))


def test_t1_counts_one_edge_of_pclk_per_byte(robot):
    """§2, §7.4: T1 counts one PCLK edge (T1CK) per byte, only within lines."""
    robot.configure(po6030())
    camera = robot.board.camera
    robot.write("PR1", 0xFFFF)
    robot.at(camera.scan.href(5) - 100).write("TMR1", 0)
    robot.write("T1CON", 0x8002)
    robot.at(camera.scan.href(6) - 100)
    assert robot.read("TMR1") == camera.scan.timing.line_bytes == 202
    robot.at(camera.scan.href(6) + 8 * 10 + 1)
    assert robot.read("TMR1") == 202 + 11


def test_polling_portc_sees_the_sync_lines(robot):
    """§2: PORTC shows HREF in bit 3 and VSYNC in bit 4."""
    robot.configure(po6030())
    scan = robot.board.camera.scan
    edge, vsync = scan.href(0), scan.edge_cycle(VSYNC, 1)
    assert [robot.at(cycle).read("PORTC") & (HREF | VSYNC) for cycle in (edge - 1, edge)] == [0, HREF]
    assert [robot.at(cycle).read("PORTC") & VSYNC for cycle in (vsync - 1, vsync)] == [0, VSYNC]


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
    """A source may draw random numbers: a look of a tool would change the rest of the trial."""
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
    """The picture of a file has no state: a look gives the byte that an instruction would read."""
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


def test_plug_is_part_of_a_snapshot(robot):
    """A camera that was plugged in at the time of a snapshot answers and sends edges after the restore."""
    state = robot.machine.snapshot()
    robot.board.camera.unplug()
    robot.machine.restore(state)
    assert 0x6E in robot.board.chip.i2c.wire.devices
    edge = robot.board.camera.scan.edge_cycle(HREF, 1)
    assert robot.at(edge).read("PORTC") & HREF


@pytest.mark.parametrize("line", [0, 40, 119])
def test_an_edge_can_be_put_on_any_cycle(robot, line):
    """`align` moves an HREF edge to any cycle, and counters of HREF count the moved edge. Tests of interrupt latency
    use this."""
    robot.configure(po6030())
    camera = robot.board.camera
    robot.at(10_000).write("T4CON", 0x8002)
    wanted = robot.events.now + 12_345
    camera.align(wanted, line)
    assert camera.scan.bits(wanted) & ~camera.scan.bits(wanted - 1) & HREF
    before = robot.at(wanted).read("TMR4")
    assert robot.at(wanted + 1).read("TMR4") == before + 1
    assert camera.scan.line_at(wanted) == (line, wanted)


def test_unplugging_in_the_middle_of_a_line_ends_it_at_once(robot):
    """Unplugging the camera ends the current line at once, both for Python and for rules."""
    robot.board.camera.show(np.full((480, 640), 255, np.uint8))
    robot.configure(po6030())
    camera = robot.board.camera
    robot.at(camera.scan.href(10) + 100)
    assert robot.read("PORTD") >> 8 == 255
    camera.unplug()
    assert robot.read("PORTD") >> 8 == 0
    assert robot.machine.record.u64[robot.machine.record.fields["camera.line_to"].index] <= robot.events.now


@pytest.mark.parametrize("seed", range(4))
def test_timers_on_sync_lines_are_switched_alike_with_and_without_the_rule(seed):
    """Switching TON of timers on HREF and VSYNC, around edges and matches, leaves the same record with the rule of
    native code and with the device's hooks."""
    robots = [Robot(), Robot()]
    bus, events = robots[0].machine.bus, [robot.events for robot in robots]
    hooks = robots[1].machine.bus
    hooks.rules[:] = [None if rule and rule.writes is write_ton else rule for rule in hooks.rules]
    followed, write = [], bus.integers.write

    def counted(rule, value, lanes):
        done = write(rule, value, lanes)
        followed.extend([done] * (rule.writes is write_ton))
        return done

    bus.integers.write = counted
    draw = random.Random(seed)
    for robot in robots:
        robot.configure(po6030())
        robot.write("PR5", 1)
        robot.later(20)
    for step in range(200):
        register, bits = draw.choice(("T4CON", "T5CON")), 0x8002
        kind = draw.random()
        if kind < 0.55:
            on = draw.random() < 0.5
            value, lanes = (0x8002 if on else 2), draw.choice((0xFFFF, 0xFF00))
        elif kind < 0.6:
            value, lanes = draw.choice((0x8002, 0x800A, 0x0012, 0x8030, 0x8012, 0x2002, 0x8022)), 0xFFFF
        elif kind < 0.8:
            register, value, lanes = draw.choice(("TMR4", "TMR5")), draw.choice((0, 0, 1, 2, 3, 50)), 0xFFFF
        elif kind < 0.9:
            register, value, lanes = draw.choice(("PR4", "PR5")), draw.choice((0, 1, 1, 2, 3, 9)), 0xFFFF
        else:
            value, lanes = bits, 0xFFFF
        camera = robots[0].board.camera
        now = events[0].now
        edge = camera.scan.nth_rise(draw.choice((HREF, HREF, VSYNC)), now, draw.choice((1, 1, 2)))
        later = draw.choice((1, 1, 2, 3, 40, max(edge - now + draw.randrange(-2, 4), 1)))
        for robot in robots:
            robot.machine.bus.write(robot.machine.chip.sfrs[register].address, value, lanes)
            robot.later(later)
            robot.machine.peripherals.pins.flush()
            robot.machine.record.u64[robot.events.deadline_index] = 0  # derived state
        counts = [[robot.read(name) for name in ("TMR4", "TMR5")] for robot in robots]
        assert counts[0] == counts[1], (step, register, hex(value), counts)
        record = robots[0].machine.record
        both = record.snapshot(), robots[1].machine.record.snapshot()
        if both[0] != both[1]:
            fields = {record.field_at(i) for i, (one, other) in enumerate(zip(*both, strict=True)) if one != other}
            pytest.fail(f"step {step}, {register} = {value:#x}, lanes {lanes:#x}: {fields}")
    assert sum(followed) > 20


def test_the_old_spelling_of_show_pixels_warns(robot: Robot) -> None:
    """`Camera.sample` of release 0.2 sets the scene and names the new spelling."""

    def pixels(_y: int, columns: Any, _cycle: int) -> Any:
        return np.zeros((len(columns), 3), np.uint8)

    with pytest.warns(DeprecationWarning, match="show_pixels"):
        robot.board.camera.sample(pixels)
    assert robot.board.camera.pixel_source is pixels
