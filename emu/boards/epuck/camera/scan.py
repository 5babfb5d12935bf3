"""Timing of the sensor's lines and bytes: HREF, VSYNC, PCLK and byte numbers in closed form (epuck.md §7.4).

All numbers are record cells `camera.<name>`, so snapshots contain them. `sensors.py` counts in columns and rows, this
module in Tcy.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple, dataclass, fields
from typing import Final

from emu.boards.epuck.camera.sensors import SensorTiming
from emu.peripherals.base import StateCell
from emu.system.events import NEVER
from emu.system.record import Record
from emu.system.rules import INTEGER_OPERATIONS, Number, RuleBuilder

HREF, VSYNC, PCLK = 1 << 3, 1 << 4, 1 << 14
"""Pins of the sync lines: RC3, RC4, RC14 (epuck.md §2)."""

_SIGN: Final = 1 << 63

LINE_PIXELS: Final = 1024
"""Maximum length of a line in pixels. Registers can request more columns than any sensor has."""


@dataclass(frozen=True, slots=True)
class FrameTiming:
    """Timing of one frame in Tcy.

    Frames repeat indefinitely. A line's first byte coincides with the rise of its HREF.
    """

    frame_tcy: int
    first_href: int
    """Tcy from the start of the frame to the rise of its first HREF."""
    line_tcy: int
    """Tcy from one HREF to the next; skipped rows have no HREF (§7.4)."""
    lines: int
    line_bytes: int
    byte_tcy: int
    """Tcy per byte: 8 in every mode of the library's fast driver (§7.3)."""
    vsync_rise: int
    vsync_fall: int


def frame_timing(timing: SensorTiming) -> FrameTiming:
    """Convert a sensor timing from columns and rows to Tcy."""
    row = timing.columns * timing.column_tcy
    visible = min(timing.end_row, timing.rows) - timing.first_row
    width = min(min(timing.end_column, timing.columns) - timing.first_column, timing.columns - 1)
    pixels = min(max(-(-width // timing.scale_x), 0), LINE_PIXELS)
    fall = min(timing.vsync_end_row, timing.rows) * row
    return FrameTiming(
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
    """Current frame timing and the start cycle of its first frame. `running` is False while the sensor is in reset."""

    def __init__(self, record: Record) -> None:
        self._cells: Final = {
            part.name: StateCell(record, f"camera.{part.name}", "Q", 1) for part in fields(FrameTiming)
        }
        self._start: Final = StateCell(record, "camera.frame_start", "q")
        self._running: Final = StateCell(record, "camera.running", "B")
        self.timing = FrameTiming(*(1 for _ in self._cells))
        self.start = 0
        self.running = False

    def begin(self, timing: FrameTiming, cycle: int, running: bool) -> None:
        """Start the first frame of `timing` in `cycle`."""
        for cell, number in zip(self._cells.values(), astuple(timing), strict=True):
            cell.value = number
        self._start.value = cycle
        self._running.value = running
        self.restored()

    def restored(self) -> None:
        """Reload the state from the record."""
        self.timing = FrameTiming(*(cell.value for cell in self._cells.values()))
        self.start = self._start.value
        self.running = bool(self._running.value)

    def place(self, cycle: int) -> tuple[int, int]:
        """Return (frame number, Tcy since that frame's start); the number is negative before the sensor starts."""
        return divmod(cycle - self.start, self.timing.frame_tcy)

    def line_at(self, cycle: int) -> tuple[int, int] | None:
        """Return (line, cycle of its HREF) for the line whose byte is on the bus at `cycle`, None between lines.

        Byte k is on the bus from HREF + (k - 1/2) to HREF + (k + 1/2) byte times (§7.5).
        """
        timing = self.timing
        frame, offset = self.place(cycle + timing.byte_tcy // 2)
        line, behind = divmod(offset - timing.first_href, timing.line_tcy)
        if not self.running or frame < 0 or not 0 <= line < timing.lines:
            return None
        return (line, self.href(line, frame)) if behind < timing.line_bytes * timing.byte_tcy else None

    def href(self, line: int, frame: int = 0) -> int:
        """Return the cycle at which HREF rises for a line (0 = first) of a frame since the last restart."""
        timing = self.timing
        return self.start + frame * timing.frame_tcy + timing.first_href + line * timing.line_tcy

    def bits(self, cycle: int) -> int:
        """Return the levels of HREF, VSYNC and PCLK in `cycle`."""
        timing = self.timing
        frame, offset = self.place(cycle)
        if not self.running or frame < 0:
            return 0
        line, behind = divmod(offset - timing.first_href, timing.line_tcy)
        levels = VSYNC if timing.vsync_rise <= offset < timing.vsync_fall else 0
        if 0 <= line < timing.lines and behind < timing.line_bytes * timing.byte_tcy:
            levels |= HREF
            if 2 * (behind % timing.byte_tcy) < timing.byte_tcy:
                levels |= PCLK
        return levels

    def rises(self, mask: int, after: int, until: int) -> int:
        """Return the number of rising edges of one sync line in after < c <= until."""
        return self.edges(mask, until) - self.edges(mask, after)

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        """Return the cycle of the `count`-th rising edge after `after`, or NEVER if there is none."""
        return self.edge_cycle(mask, self.edges(mask, after) + count)

    def constant_until(self, cycle: int) -> int:
        """Return the cycle of the next edge of a sync line; while PCLK runs, `cycle` itself (no guarantee)."""
        timing = self.timing
        frame, offset = self.place(cycle)
        if not self.running:
            return NEVER
        if frame < 0:
            return self.start
        line, behind = divmod(offset - timing.first_href, timing.line_tcy)
        if 0 <= line < timing.lines and behind < timing.line_bytes * timing.byte_tcy:
            return cycle
        edges = (timing.vsync_rise, timing.vsync_fall, self._next_line(offset), timing.frame_tcy)
        return cycle + min(edge for edge in edges if edge > offset) - offset

    def changes(self, after: int, until: int) -> Iterator[tuple[int, int, int]]:
        """Yield the levels of VSYNC and HREF in cycle `after` + 1 and at their edges in after < cycle <= until.

        PCLK is omitted: it has millions of edges in a second.
        """
        cycle = after + 1
        while cycle <= until:
            yield cycle, VSYNC | HREF, self.bits(cycle)
            cycle = self._next_edge(cycle) if self.running else until + 1

    def _next_edge(self, cycle: int) -> int:
        """Return the cycle of the next edge of VSYNC or HREF, or the end of the frame, after `cycle`."""
        timing = self.timing
        frame, offset = self.place(cycle)
        if frame < 0:
            return self.start
        line = min(max((offset - timing.first_href) // timing.line_tcy, 0), timing.lines - 1)
        line_end = timing.first_href + line * timing.line_tcy + timing.line_bytes * timing.byte_tcy
        edges = (timing.vsync_rise, timing.vsync_fall, line_end, self._next_line(offset), timing.frame_tcy)
        return cycle + min(edge for edge in edges if edge > offset) - offset

    def _next_line(self, offset: int) -> int:
        """Return the offset in the frame of the first HREF after `offset`, or the end of the frame."""
        timing = self.timing
        line = max((offset - timing.first_href) // timing.line_tcy + 1, 0)
        return timing.first_href + line * timing.line_tcy if line < timing.lines else timing.frame_tcy

    def next_line(self, cycle: int) -> int:
        """Return the first cycle after `cycle` at which `line_at` may return a line; NEVER in reset.

        `cycle` must be between lines.
        """
        timing = self.timing
        half = timing.byte_tcy // 2
        frame, offset = self.place(cycle + half)
        if not self.running:
            return NEVER
        return self.start - half if frame < 0 else cycle + self._next_line(offset) - offset

    def edges(self, mask: int, cycle: int) -> int:
        """Return the number of rising edges of one sync line since the start, up to and including `cycle`."""
        return int(edges(INTEGER_OPERATIONS, mask, self.timing, (self.start, self.running), cycle))

    def edge_cycle(self, mask: int, number: int) -> int:
        """Return the cycle of the `number`-th (1 = first) rising edge since the start, or NEVER."""
        return int(edge_cycle(INTEGER_OPERATIONS, mask, self.timing, (self.start, self.running), number))

    def nth_rise_rule(self, m: RuleBuilder, mask: int, after: Number, count: Number) -> Number:
        """Return `nth_rise` as a rule expression."""
        timing = FrameTiming(*(m.get(cell.cell) for cell in self._cells.values()))
        start = (m.get(self._start.cell) ^ _SIGN) - _SIGN
        begun = (start, m.get(self._running.cell))
        return edge_cycle(m, mask, timing, begun, edges(m, mask, timing, begun, after) + count)


def edges(m: RuleBuilder, mask: int, timing: FrameTiming, begun: tuple[Number, Number], cycle: Number) -> Number:
    """Return `Scan.edges` as a rule expression.

    `begun`: start cycle of the first frame, and whether the sensor runs.
    """
    start, running = begun
    counts = (cycle >= start) & (running != 0)
    passed = m.select(counts, cycle - start, 0)
    frame, offset = m.div(passed, timing.frame_tcy), m.mod(passed, timing.frame_tcy)
    if mask == VSYNC:
        found: Number = (timing.vsync_rise <= offset) & (timing.vsync_rise < timing.vsync_fall)
    else:
        behind = m.select(offset < timing.first_href, 0, offset - timing.first_href)
        reached = m.div(behind, timing.line_tcy) + 1
        lines = m.select(reached < timing.lines, reached, timing.lines)
        found = lines
        if mask == PCLK:
            inside = m.div(behind - m.select(lines == 0, 0, lines - 1) * timing.line_tcy, timing.byte_tcy) + 1
            found = (lines - 1) * timing.line_bytes + m.select(inside < timing.line_bytes, inside, timing.line_bytes)
        found = m.select((offset < timing.first_href) | (lines == 0), 0, found)
    return m.select(counts, frame * per_frame(mask, timing) + found, 0)


def edge_cycle(m: RuleBuilder, mask: int, timing: FrameTiming, begun: tuple[Number, Number], number: Number) -> Number:
    """Return `Scan.edge_cycle` as a rule expression."""
    start, running = begun
    rate = per_frame(mask, timing)
    none = (running == 0) | (rate == 0)
    most = m.select(none, 1, rate)
    frame, index = m.div(number - 1, most), m.mod(number - 1, most)
    if mask == VSYNC:
        offset = timing.vsync_rise
    else:
        width = m.select(timing.line_bytes == 0, 1, timing.line_bytes)
        line, byte = (m.div(index, width), m.mod(index, width)) if mask == PCLK else (index, 0)
        offset = timing.first_href + line * timing.line_tcy + byte * timing.byte_tcy
    return m.select(none, NEVER, start + frame * timing.frame_tcy + offset)


def per_frame(mask: int, timing: FrameTiming) -> Number:
    """Return the number of rising edges of a sync line per frame."""
    if mask == VSYNC:
        return timing.vsync_rise < timing.vsync_fall
    return timing.lines * timing.line_bytes if mask == PCLK else timing.lines
