"""When the sensor's lines and bytes come: HREF, VSYNC, PCLK and byte numbers in closed form (epuck.md §7.4).

Every number is a record cell `camera.<name>`, so that a snapshot has it. Sensors
know columns and rows; here everything is Tcy.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields
from typing import Final

from emu.boards.epuck.camera.sensors import Timing
from emu.peripherals.base import Cell
from emu.system.events import NEVER
from emu.system.record import Record
from emu.system.rules import NUMBERS, Number, Reader

HREF, VSYNC, PCLK = 1 << 3, 1 << 4, 1 << 14
"""RC3, RC4, RC14 (epuck.md §2)."""

_SIGN: Final = 1 << 63

LINE_PIXELS: Final = 1024
"""Longest line: no sensor has more columns, but registers can ask for them."""


@dataclass(frozen=True, slots=True)
class Course:
    """One frame in Tcy; it repeats for ever. A line's bytes and its HREF begin together."""

    frame_tcy: int
    first_href: int
    """From the start of the frame to the rise of its first HREF."""
    line_tcy: int
    """From one HREF to the next: skipped rows have none (§7.4)."""
    lines: int
    line_bytes: int
    byte_tcy: int
    """8 in every mode of the library's fast driver (§7.3)."""
    vsync_rise: int
    vsync_fall: int


def course_of(timing: Timing) -> Course:
    """Columns and rows to Tcy."""
    row = timing.columns * timing.column_tcy
    visible = min(timing.end_row, timing.rows) - timing.first_row
    width = min(min(timing.end_column, timing.columns) - timing.first_column, timing.columns - 1)
    pixels = min(max(-(-width // timing.scale_x), 0), LINE_PIXELS)
    fall = min(timing.vsync_end_row, timing.rows) * row
    return Course(
        frame_tcy=row * timing.rows,
        first_href=timing.first_row * row + timing.first_column * timing.column_tcy,
        line_tcy=row * timing.scale_y,
        lines=max(-(-visible // timing.scale_y), 0) if pixels else 0,
        line_bytes=pixels * timing.bytes_per_pixel,
        byte_tcy=max(timing.column_tcy * timing.scale_x // timing.bytes_per_pixel, 1),
        vsync_rise=min(timing.vsync_row * row + timing.vsync_column * timing.column_tcy, fall),
        vsync_fall=fall,
    )


class Scan:
    """The course in force and the cycle its first frame began. `running` is 0 in reset."""

    def __init__(self, record: Record) -> None:
        self._cells: Final = {part.name: Cell(record, f"camera.{part.name}", "Q", 1) for part in fields(Course)}
        self._start: Final = Cell(record, "camera.frame_start", "q")
        self._running: Final = Cell(record, "camera.running", "B")
        self.course = Course(*(1 for _ in self._cells))
        self.start = 0
        self.running = False

    def begin(self, course: Course, cycle: int, running: bool) -> None:
        """The first frame of `course` starts in `cycle`."""
        for cell, number in zip(self._cells.values(), astuple(course), strict=True):
            cell.value = number
        self._start.value = cycle
        self._running.value = running
        self.restored()

    def restored(self) -> None:
        """Take over what the record says."""
        self.course = Course(*(cell.value for cell in self._cells.values()))
        self.start = self._start.value
        self.running = bool(self._running.value)

    def place(self, cycle: int) -> tuple[int, int]:
        """(frame, Tcy since its start); the frame is negative before the sensor started."""
        return divmod(cycle - self.start, self.course.frame_tcy)

    def line_at(self, cycle: int) -> tuple[int, int] | None:
        """(line, cycle of its HREF) whose byte is on the bus in `cycle`, None between lines.

        Byte k is there from HREF + (k - 1/2) to HREF + (k + 1/2) byte times (§7.5).
        """
        course = self.course
        frame, offset = self.place(cycle + course.byte_tcy // 2)
        line, behind = divmod(offset - course.first_href, course.line_tcy)
        if not self.running or frame < 0 or not 0 <= line < course.lines:
            return None
        return (line, self.href(line, frame)) if behind < course.line_bytes * course.byte_tcy else None

    def href(self, line: int, frame: int = 0) -> int:
        """Cycle in which HREF rises for a line (0 = first of the frame) of a frame since the last restart."""
        course = self.course
        return self.start + frame * course.frame_tcy + course.first_href + line * course.line_tcy

    def bits(self, cycle: int) -> int:
        """Levels of HREF, VSYNC and PCLK in `cycle`."""
        course = self.course
        frame, offset = self.place(cycle)
        if not self.running or frame < 0:
            return 0
        line, behind = divmod(offset - course.first_href, course.line_tcy)
        levels = VSYNC if course.vsync_rise <= offset < course.vsync_fall else 0
        if 0 <= line < course.lines and behind < course.line_bytes * course.byte_tcy:
            levels |= HREF
            if 2 * (behind % course.byte_tcy) < course.byte_tcy:
                levels |= PCLK
        return levels

    def rises(self, mask: int, after: int, until: int) -> int:
        """Rising edges of one line in after < c <= until."""
        return self.edges(mask, until) - self.edges(mask, after)

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        """Cycle of the `count`-th rising edge behind `after`, or NEVER."""
        return self.edge_cycle(mask, self.edges(mask, after) + count)

    def stands_until(self, cycle: int) -> int:
        """The next edge of a sync line; nothing is promised while PCLK runs."""
        course = self.course
        frame, offset = self.place(cycle)
        if not self.running:
            return NEVER
        if frame < 0:
            return self.start
        line, behind = divmod(offset - course.first_href, course.line_tcy)
        if 0 <= line < course.lines and behind < course.line_bytes * course.byte_tcy:
            return cycle
        edges = (course.vsync_rise, course.vsync_fall, self._next_line(offset), course.frame_tcy)
        return cycle + min(edge for edge in edges if edge > offset) - offset

    def _next_line(self, offset: int) -> int:
        """Offset in the frame of the first HREF behind `offset`, or the end of the frame."""
        course = self.course
        line = max((offset - course.first_href) // course.line_tcy + 1, 0)
        return course.first_href + line * course.line_tcy if line < course.lines else course.frame_tcy

    def next_line(self, cycle: int) -> int:
        """Cycle from which `line_at` may name a line again, for a `cycle` between lines; NEVER in reset."""
        course = self.course
        half = course.byte_tcy // 2
        frame, offset = self.place(cycle + half)
        if not self.running:
            return NEVER
        return self.start - half if frame < 0 else cycle + self._next_line(offset) - offset

    def edges(self, mask: int, cycle: int) -> int:
        """Rising edges of one sync line since the start, up to and with `cycle`."""
        return int(edges(NUMBERS, mask, self.course, (self.start, self.running), cycle))

    def edge_cycle(self, mask: int, number: int) -> int:
        """Cycle of the `number`-th (1 = first) rising edge since the start, or NEVER."""
        return int(edge_cycle(NUMBERS, mask, self.course, (self.start, self.running), number))

    def text_of_rise(self, m: Reader, mask: int, after: Number, count: Number) -> Number:
        """`nth_rise` for every engine."""
        course = Course(*(m.get(cell.place) for cell in self._cells.values()))
        start = (m.get(self._start.place) ^ _SIGN) - _SIGN
        begun = (start, m.get(self._running.place))
        return edge_cycle(m, mask, course, begun, edges(m, mask, course, begun, after) + count)


def edges(m: Reader, mask: int, course: Course, begun: tuple[Number, Number], cycle: Number) -> Number:
    """Text of `Scan.edges`. `begun`: the cycle the first frame began, and whether it did."""
    start, running = begun
    counts = (cycle >= start) & (running != 0)
    passed = m.select(counts, cycle - start, 0)
    frame, offset = m.div(passed, course.frame_tcy), m.mod(passed, course.frame_tcy)
    if mask == VSYNC:
        found: Number = (course.vsync_rise <= offset) & (course.vsync_rise < course.vsync_fall)
    else:
        behind = m.select(offset < course.first_href, 0, offset - course.first_href)
        reached = m.div(behind, course.line_tcy) + 1
        lines = m.select(reached < course.lines, reached, course.lines)
        found = lines
        if mask == PCLK:
            inside = m.div(behind - m.select(lines == 0, 0, lines - 1) * course.line_tcy, course.byte_tcy) + 1
            found = (lines - 1) * course.line_bytes + m.select(inside < course.line_bytes, inside, course.line_bytes)
        found = m.select((offset < course.first_href) | (lines == 0), 0, found)
    return m.select(counts, frame * per_frame(mask, course) + found, 0)


def edge_cycle(m: Reader, mask: int, course: Course, begun: tuple[Number, Number], number: Number) -> Number:
    """Text of `Scan.edge_cycle`."""
    start, running = begun
    rate = per_frame(mask, course)
    none = (running == 0) | (rate == 0)
    most = m.select(none, 1, rate)
    frame, index = m.div(number - 1, most), m.mod(number - 1, most)
    if mask == VSYNC:
        offset = course.vsync_rise
    else:
        width = m.select(course.line_bytes == 0, 1, course.line_bytes)
        line, byte = (m.div(index, width), m.mod(index, width)) if mask == PCLK else (index, 0)
        offset = course.first_href + line * course.line_tcy + byte * course.byte_tcy
    return m.select(none, NEVER, start + frame * course.frame_tcy + offset)


def per_frame(mask: int, course: Course) -> Number:
    """Rising edges of a sync line in a frame."""
    if mask == VSYNC:
        return course.vsync_rise < course.vsync_fall
    return course.lines * course.line_bytes if mask == PCLK else course.lines
