"""Edges of the camera's sync lines in a VCD file (epuck.md §7.4)."""

from __future__ import annotations

import io

from emu.instruments.vcd import WaveformRecorder


def rising_edges(text: str, pin: str) -> list[int]:
    """Return the times of a pin's rising edges after the start of the file."""
    name = next(line.split()[3] for line in text.splitlines() if line.startswith("$var") and f" {pin}" in line)
    time, found = 0, []
    for line in text.split("$enddefinitions")[1].splitlines():
        if line.startswith("#"):
            time = int(line[1:])
        elif line == f"1{name}":
            found.append(time)
    return found


def test_the_lines_of_a_frame_are_in_the_file(robot) -> None:
    """HREF rises once per line and VSYNC once per frame, each in its own cycle."""
    machine, out = robot.machine, io.StringIO()

    def advance(cycle: int) -> None:
        robot.at(cycle)
        machine.state.cycle = cycle

    recorder = WaveformRecorder(machine, out, [], advance)
    robot.at(100).output("RC13", 0)
    robot.at(200).output("RC13", 1)
    scan = robot.board.camera.scan
    timing, first = scan.timing, scan.href(0)
    recorder.advance(first + timing.frame_tcy - 1)
    recorder.close()
    lines = rising_edges(out.getvalue(), "RC3")
    assert len(lines) == timing.lines
    assert lines[0] == round(first * 10**12 / machine.hz)
    assert len(rising_edges(out.getvalue(), "RC4")) == 1
