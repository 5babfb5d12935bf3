"""Native rendering of camera lines (`line.c`) leaves the same record as Python, line by line, for every setting."""

from __future__ import annotations

import random
from ctypes import addressof, c_int64
from typing import Any

import numpy as np
import pytest

from emu.boards.epuck.camera.camera import Camera
from emu.boards.epuck.camera.pixels import StillImage, line_code

from ..conftest import Robot
from .camera_driver import po3030, po6030, scene

DARK = [(0, 0xD4, 0x2C)]
"""Register writes for manual exposure of a PO3030K."""


def render_both(robot: Robot, camera: Camera, cycle: int, pixels: np.ndarray) -> tuple[bool, bool]:
    """Render a line in Python and in native code and compare the records. Return for each whether it rendered the
    line."""
    record, href = robot.machine.record, c_int64()
    before = record.snapshot()
    by_python = camera._refresh(cycle)
    python = record.snapshot()
    record.restore(before)
    code = line_code()
    row = code["row_on_bus"](addressof(camera.native), camera.native.setting, cycle, addressof(href))
    if row < 0:
        record.restore(python)
        return by_python, False
    seen = np.ascontiguousarray(pixels[row][camera._readout._columns])
    code["write_line"](addressof(camera.native), href.value, seen.ctypes.data)
    assert record.snapshot() == python
    return by_python, True


@pytest.mark.parametrize(("sensor", "writes"), [
    ("PO6030K", po6030()), ("PO6030K", po6030(scale=2, form="yuv")), ("PO6030K", po6030(scale=1, form="grey")),
    ("PO3030K", po3030()), ("PO3030K", po3030(scale=1, form="grey") + DARK), ("PO3030K", po3030(form="yuv") + DARK),
])  # fmt: skip
@pytest.mark.parametrize("lamp", [1.0, 0.37])
def test_native_and_python_lines_are_equal(sensor: str, writes: list[tuple[int, int, int]], lamp: float) -> None:
    """Native and Python lines are equal; Python must render only while automatic exposure differs from its initial
    value."""
    robot, pixels, draw = Robot(camera=sensor), scene(), random.Random(repr((sensor, writes)))
    robot.configure(writes)
    camera = robot.board.camera
    camera.show_pixels(lambda y, columns, _cycle: pixels[y, columns], has_native_source=True)
    camera.lamp = lamp
    course = camera.scan.timing
    assert camera._refresh(camera.scan.href(0, 3))  # Python renders first
    assert camera.native.setting
    both = 0
    for _ in range(300):
        line = draw.randrange(course.lines)
        cycle = camera.scan.href(line, draw.randrange(9)) + draw.randrange(-course.byte_tcy, course.line_tcy)
        by_python, by_code = render_both(robot, camera, cycle, pixels)
        assert by_code <= by_python
        steady = lamp == 1.0 or writes[-1:] == DARK
        assert by_code == (by_python and steady)
        both += by_code
    assert not steady or both > 10


@pytest.mark.parametrize("sensor", ["PO6030K", "PO3030K"])
def test_a_still_picture_is_rendered_like_a_callback(sensor: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A still picture is rendered like a callback while settings, lamp and connector change; native code uses the
    published settings."""
    pixels, draw = scene(), random.Random(sensor)
    still, other = Robot(camera=sensor), Robot(camera=sensor)
    still.board.camera.show(pixels)
    other.board.camera.show_pixels(lambda y, columns, _cycle: pixels[y, columns])
    at_once = 0
    paint = StillImage.render_natively

    def counted(*line: Any) -> bool:
        nonlocal at_once
        done = paint(*line)
        at_once += done
        return done

    monkeypatch.setattr(StillImage, "render_natively", counted)
    settings = [po6030(), po6030(scale=2, form="yuv")] if sensor == "PO6030K" else [po3030(), po3030(form="yuv") + DARK]
    for _ in range(12):
        writes, lamp, is_plugged = draw.choice(settings), draw.choice([1.0, 1.0, 1.0, 1.0, 0.5]), draw.random() < 0.9
        for robot in (still, other):
            robot.configure(writes)
            robot.board.camera.lamp = lamp
            (robot.board.camera.plug if is_plugged else robot.board.camera.unplug)()
        scan = still.board.camera.scan
        for _ in range(200):
            line = draw.randrange(10)
            cycle = scan.href(line, draw.randrange(9)) + draw.randrange(-scan.timing.byte_tcy, scan.timing.line_tcy)
            found = [robot.board.camera._refresh(cycle) for robot in (still, other)]
            assert found[0] == found[1]
            assert still.machine.record.snapshot() == other.machine.record.snapshot()
    assert at_once > 100


def test_python_renders_first_after_every_change() -> None:
    """Changes of registers, sources and snapshots invalidate the published settings, so Python renders the next
    line."""
    robot, pixels = Robot(), scene()
    robot.configure(po6030())
    camera, href = robot.board.camera, c_int64()

    def painted_by_code(cycle: int) -> int:
        return line_code()["row_on_bus"](addressof(camera.native), camera.native.setting, cycle, addressof(href))

    def asked() -> bool:
        cycle = camera.scan.href(3, 2)
        camera._line_to.value = 0
        first = painted_by_code(cycle)
        assert camera._refresh(cycle)
        camera._line_to.value = 0
        again, row = painted_by_code(cycle), camera._readout._rows[3]
        assert again in (first, row)
        assert first in (-1, row)
        return first < 0 <= again

    def source(y, columns, _cycle):
        return pixels[y, columns]

    camera.show_pixels(source, has_native_source=True)
    assert asked()
    assert not asked()
    kept = robot.machine.snapshot()
    robot.configure(po6030(form="yuv"))
    assert asked()
    robot.machine.restore(kept)
    assert asked()
    camera.show_pixels(source)
    assert not asked()
    assert not camera.native.setting
    camera.show_pixels(source, has_native_source=True)
    assert asked()
    setting = camera.native.setting
    assert painted_by_code(camera.scan.href(3, 2)) >= 0
    row_on_bus = line_code()["row_on_bus"]
    assert row_on_bus(addressof(camera.native), setting + 1, camera.scan.href(3, 2), addressof(href)) == -1
    camera.unplug()
    assert painted_by_code(camera.scan.href(3, 2)) == -1
