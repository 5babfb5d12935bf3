"""HREF of the camera at every cycle of a round of kernel calls (kernel.md §4).

A round of tests/firmware/target/capture makes every call of the kernel and its devices while the clock, slices,
stepper, UARTs, converter, I2C and remote control interrupt. `sweep` executes the round by instructions. From a copy
of each state it raises HREF at each cycle of the instruction and compares the captured line.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from emu.api import Machine
from emu.boards.epuck.board import Epuck
from emu.boards.epuck.camera.pixels import decode
from emu.image.loader import load_image

FCY = 14_745_600
AHEAD = 12
"""Tcy from the copied state to the first edge: the camera model accepts future edges only."""
LINE = 40
LINE_BYTES = 40
LINE_TCY = AHEAD + 760
"""Tcy until the capture interrupt ends: 10 + 20 x 32 + about 20 Tcy and its latency."""
LONGEST_STEP = 64
"""Maximum Tcy of an instruction; a longer step is a sleep.

The cycles of a sleep are alike, so that after the first LONGEST_STEP only every IDLE_STRIDE-th is tried.
"""
IDLE_STRIDE = 61


def start(path: Path, picture: np.ndarray, ipl_slip: int = 0) -> Machine:
    """Return the machine at the start of a round of the firmware `capture`, with the camera programmed."""
    image = load_image(path)
    machine = Machine(image.chip, engine="auto", ipl_slip=ipl_slip, board=partial(Epuck, selector=3))
    machine.load(image)
    machine.board.camera.show(picture)
    begin = place(machine, "round_begin")
    for _ in range(4):
        assert machine.run(cycles=FCY, until=begin).reason == "until"
        machine.step()
        for timer in ("T4CON", "T5CON"):  # stop the camera's own frames: the test chooses the line; an order for
            machine.write(timer, 0x0002)  # the next frame comes within the round that follows
    assert machine.peek("failures") == 0
    return machine


def place(machine: Machine, symbol: str) -> int:
    """Return the program address of a C function."""
    assert machine.image is not None
    found = machine.image.symbols.find("_" + symbol)
    assert found is not None, symbol
    return found.address


def expected_line(picture: np.ndarray) -> np.ndarray:
    """Return the expected pixels of window line LINE: every eighth pixel, in RGB565 (epuck.md §7.5)."""
    row = 4 * LINE  # the sensor sends every fourth row
    return picture[row, 240:400:8] & np.array([0xF8, 0xFC, 0xF8], np.uint8)


def capture_at(machine: Machine, state: bytes, offset: int, masked: int = 0) -> np.ndarray:
    """Return the pixels of the line whose HREF rises `AHEAD + offset` Tcy after `state`.

    `masked`: number of Tcy after HREF in which interrupts are masked, to prove that a late capture spoils the line.
    """
    machine.restore(state)
    machine.board.camera.align(machine.cycle + AHEAD + offset, LINE)
    frame = machine.address_of("frame")
    machine.record.bytes[frame : frame + LINE_BYTES] = bytes(LINE_BYTES)
    machine.poke("camera_next_byte", frame)
    machine.poke("camera_lines_left", 20)
    machine.write("T4CON", 0x0002)
    machine.write("PR4", 1)
    machine.write("TMR4", 0)
    machine.poke("IFS1", machine.peek("IFS1") & ~(1 << 5))
    machine.write("T4CON", 0x8002)  # the next HREF triggers
    if masked:
        machine.write("DISICNT", AHEAD + offset + masked)
    machine.run(cycles=offset + LINE_TCY)
    return decode(bytes(machine.record.bytes[frame : frame + LINE_BYTES]), "rgb565")


def offsets(step: int) -> Iterator[int]:
    """Yield the cycle offsets to be tried within an instruction or a sleep."""
    yield from range(min(step, LONGEST_STEP))
    yield from range(LONGEST_STEP, step, IDLE_STRIDE)


def sweep(machine: Machine, picture: np.ndarray, stride: int, phase: int = 0) -> int:
    """Try every `stride`-th cycle of a round from `phase` on; return the number of tried cycles.

    Raise AssertionError with cycle, program address and pixels of the first wrong line.
    """
    expected = expected_line(picture)
    end = place(machine, "round_end")
    cycle_number = tried = 0
    while machine.pc != end:
        chosen = -(cycle_number - phase) % stride < 2 * LONGEST_STEP  # only steps that may hold a tested cycle
        here, pc, before = machine.snapshot() if chosen else b"", machine.pc, machine.cycle
        machine.step()
        wanted = []
        for offset in offsets(machine.cycle - before):
            if cycle_number % stride == phase:
                wanted.append(offset)
            cycle_number += 1
        if not wanted:
            continue
        after = machine.snapshot()
        for offset in wanted if chosen else ():
            seen = capture_at(machine, here, offset)
            assert np.array_equal(seen, expected), f"pc {pc:#08x}, cycle {before}, HREF + {offset}:\n{seen}"
            tried += 1
        machine.restore(after)
    assert machine.peek("failures") == 0
    return tried
