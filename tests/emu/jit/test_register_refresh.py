"""Registers that a device refreshes before native reads, and accesses that must not refresh them."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from emu.boards.epuck.board import Epuck
from emu.dspic30f.isa.text import parse
from emu.dspic30f.jit.environment import REFRESHED
from emu.machine.machine import Machine
from emu.system.native_handle import FRESH_ROOM
from tests.emu.jit.comparison.random_firmware import difference

LOOP = 0x200
CYCLES = 160_000
"""Length of the run: a tenth of a frame of the PO6030K."""


class Number:
    """Operand of the assembly parser."""

    def __init__(self, text: str) -> None:
        self.value: int | None = int(text, 0)


def machine(engine: str, program: str, lines: list[int]) -> Machine:
    """Return a robot that will run `program` for ever, and whose camera records the rows it renders."""

    def row(y: int, columns: np.ndarray, _cycle: int) -> np.ndarray:
        lines.append(y)
        return np.full((len(columns), 3), y & 0xFF, np.uint8)

    made = Machine(engine=engine, board=partial(Epuck, camera="PO6030K"))
    if engine == "jit":
        made.runner.threshold, made.runner.wait = 1, True
    made.program.put(0xF80002, 0x7FFF)
    made.reset("POR")
    at = LOOP
    for line in [*program.strip().splitlines(), f"goto {LOOP:#x}"]:
        for word in parse(line.strip(), Number).encode(at):
            made.program.put(at, word)
            at += 2
    made.pc = LOOP
    made.board.camera.show_pixels(row)
    return made


WRITES = """
    mov w0, 0x2D4
    nop
    mov w0, 0x2D6
    nop
    mov.b WREG, 0x2D5
    push w0
    pop 0x2D4
"""
READS = """
    mov 0x2D4, w1
    mov.b 0x2D5, WREG
    btss 0x2D4, #3
    push 0x2D4
    pop w3
"""
LATCHES = """
    mov 0x2CE, w1
    btg 0x2D0, #1
    mov 0x2CE, w2
    btg 0x2D6, #4
    mov 0x2D4, w3
    btg 0x2D6, #4
"""
"""Reads and changes of latches. TRISC is at 0x2CC, followed by PORTC and LATC; TRISD is at 0x2D2, PORTD 0x2D4, LATD
0x2D6."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "inputs", "rendered"),
    [(WRITES, 0, False), (WRITES, 0xFF00, False), (READS, 0xFF00, True), (LATCHES, 0xFF00, True)],
)
def test_engines_render_the_same_lines_and_leave_the_same_state(program: str, inputs: int, rendered: bool) -> None:
    """A write of PORTD does not render the camera line, a read does. A latch write that changes pins invalidates the
    published waveform, in native code as in the device (emu/peripherals/pins.py)."""
    lines: dict[str, list[int]] = {"plain": [], "jit": []}
    machines = {engine: machine(engine, program, seen) for engine, seen in lines.items()}
    for made in machines.values():
        made.write("TRISD", inputs)
        made.write("TRISC", 0xFFFD)
    for _ in range(4):
        stops = {engine: made.run(cycles=CYCLES // 4) for engine, made in machines.items()}
        assert len({str(stop) for stop in stops.values()}) == 1, stops
        assert not difference(machines["plain"], machines["jit"])
    assert lines["plain"] == lines["jit"]
    assert bool(lines["plain"]) == rendered


def test_the_list_of_refreshed_instructions_ends_with_zero() -> None:
    """The list ends with 0 for the host program, also after more instructions than fit, one of them twice."""
    runner = machine("jit", "nop", []).runner
    for address in (2, *range(2, 8 * FRESH_ROOM, 2)):
        runner._remember_refresh(address)
    assert list(runner._env[REFRESHED : REFRESHED + FRESH_ROOM]) == [*range(2, 2 * FRESH_ROOM, 2), 0]
