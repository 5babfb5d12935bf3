"""Closed forms of the camera's signals equal a cycle-by-cycle model; arbitrary register values are accepted."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emu.boards.epuck.camera.scan import HREF, PCLK, VSYNC, FrameTiming, Scan
from emu.boards.epuck.camera.sensors import SENSORS
from emu.system.record import Record

from ..conftest import Robot


@st.composite
def courses(draw):
    """Return scans with small frames: some lines end before the next begins and lie inside the frame, others do not."""
    byte_tcy, line_bytes = draw(st.integers(1, 9)), draw(st.integers(0, 6))
    line_tcy = line_bytes * byte_tcy + draw(st.integers(1, 12))
    lines = draw(st.integers(0, 5)) if line_bytes else 0
    first = draw(st.integers(0, 20))
    frame = first + lines * line_tcy + draw(st.integers(1, 30))
    rise = draw(st.integers(1, frame))
    return FrameTiming(frame, first, line_tcy, lines, line_bytes, byte_tcy, rise, draw(st.integers(rise, frame)))


def ticking(course, cycles):
    """Return the levels and the byte on the bus in every cycle, from nested loops instead of divisions."""
    levels, bytes_ = [0] * cycles, [None] * cycles
    for frame in range(0, cycles + course.frame_tcy, course.frame_tcy):
        for cycle in range(frame + course.vsync_rise, min(frame + course.vsync_fall, cycles)):
            levels[cycle] |= VSYNC
        for line in range(course.lines):
            start = frame + course.first_href + line * course.line_tcy
            for byte in range(course.line_bytes):
                for tick in range(course.byte_tcy):
                    cycle = start + byte * course.byte_tcy + tick
                    if cycle < cycles:
                        levels[cycle] |= HREF | (PCLK if 2 * tick < course.byte_tcy else 0)
                    early = cycle - course.byte_tcy // 2
                    if 0 <= early < cycles:
                        bytes_[early] = (line, byte)
    return levels, bytes_


@settings(max_examples=150, deadline=None)
@given(courses(), st.integers(0, 100))
def test_closed_forms_equal_a_cycle_by_cycle_model(course, start):
    """epuck.md §7.4: levels, edge counts, next edges and bytes of the closed forms equal the model in every cycle of
    three frames."""
    scan = Scan(Record(0))
    scan.begin(course, start, running=True)
    cycles = 3 * course.frame_tcy
    levels, bytes_ = ticking(course, cycles)
    assert [scan.bits(start + cycle) for cycle in range(cycles)] == levels
    for cycle, expected in enumerate(bytes_):
        found = scan.line_at(start + cycle)
        if expected is None:
            assert found is None
        else:
            line, byte = expected
            assert found is not None
            assert found[0] == line
            assert (start + cycle - found[1] + course.byte_tcy // 2) // course.byte_tcy == byte
    for mask in (HREF, VSYNC) if course.byte_tcy == 1 else (HREF, VSYNC, PCLK):
        rises = [c for c in range(cycles) if levels[c] & mask and not (c and levels[c - 1] & mask)]
        counted = [scan.edges(mask, start + cycle) for cycle in range(cycles)]
        assert counted == [sum(rise <= cycle for rise in rises) for cycle in range(cycles)]
        for number, rise in enumerate(rises, start=1):
            assert scan.nth_rise(mask, start - 1, number) == start + rise


@pytest.mark.parametrize("sensor", sorted(SENSORS))
def test_no_register_value_breaks_the_sensor(sensor):
    """With any register values, edges still alternate and bytes are still sent."""
    generator = random.Random(sensor)
    for _ in range(20):
        robot = Robot(camera=sensor)
        camera = robot.board.camera
        banks = camera.sensor.banks
        robot.configure(
            (generator.randrange(banks), generator.randrange(4, 256), generator.randrange(256)) for _ in range(300)
        )
        scan = camera.scan
        for _ in range(20):
            cycle = generator.randrange(3 * scan.timing.frame_tcy)
            camera.bits(cycle)
            for mask in (HREF, VSYNC):
                edge = scan.nth_rise(mask, cycle, 1)
                if edge < 1 << 60:
                    assert edge > cycle
                    assert scan.bits(edge) & mask
                    assert not scan.bits(edge - 1) & mask
        if scan.timing.lines:
            camera.bits(scan.href(scan.timing.lines - 1))
