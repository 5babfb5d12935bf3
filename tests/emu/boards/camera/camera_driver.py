"""A camera driver in Python: register writes, and a capture in the cycles in which the library's handler reads."""

from __future__ import annotations

import numpy as np

from emu.boards.epuck.camera.scan import HREF

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
