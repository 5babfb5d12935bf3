"""An assembly program prints a line at 115,200 baud from a T1 interrupt; each start bit is at the exact cycle."""

from __future__ import annotations

import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from emu.api import load
from tests.emu.cli.programs import SETUP, executable
from tests.watchdog import HANG

LINE = "swarm\n"
BIT_TCY = 16 * (7 + 1)
"""Tcy per bit with BRG = 7 (dspic30f6014a.md §10): Fcy / 115,200 = 128."""

PROGRAM = (
    "main:\n"
    "mov #0x900, w15\n"
    + "".join(f"mov #{ord(letter)}, w1\nmov w1, {0x810 + 2 * number:#x}\n" for number, letter in enumerate(LINE))
    + f"mov #0x810, w10\nmov #{len(LINE)}, w11\n"
    + SETUP
    + """
    mov #1999, w0
    mov w0, {PR1}
    bset {IEC0}, #3
    mov #0x8000, w0
    mov w0, {T1CON}
loop:
    pwrsav #1
    cp0 w11
    bra nz, @loop
    clr {T1CON}
    bclr {IEC0}, #3
    pwrsav #1
forever:
    bra @forever
tick:
    mov [w10++], w1
    mov w1, {U1TXREG}
    dec w11, w11
    bclr {IFS0}, #3
    retfie
"""
)


@pytest.fixture
def image(tmp_path: Path) -> Path:
    """Return the program as an ELF file."""
    path = tmp_path / "line.elf"
    path.write_bytes(executable(PROGRAM, {"T1Interrupt": "tick"}))
    return path


def test_the_line_is_on_the_terminal(image: Path) -> None:
    """`python -m emu run` prints what UART1 sends."""
    done = subprocess.run(
        [sys.executable, "-m", "emu", "run", str(image)],
        capture_output=True, text=True, timeout=HANG, check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == LINE


@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_every_start_bit_is_on_the_next_edge_of_the_bit_clock(image: Path, engine: str) -> None:
    """Every start bit begins at the next edge of the bit clock, which runs from the cycle after the write of UARTEN
    (dspic30f6014a.md §10.1)."""
    machine = load(image, engine=engine)
    enabled: list[int] = []
    written: list[int] = []
    sent: list[tuple[int, int]] = []
    machine.hook_sfr("U1MODE", lambda is_write, _word: enabled.append(machine.events.now) if is_write else None)
    machine.hook_sfr("U1TXREG", lambda is_write, _word: written.append(machine.events.now) if is_write else None)
    machine.uart[1].on_byte = lambda byte, start: sent.append((byte, start))
    assert machine.run(cycles=100_000).reason == "halt"
    assert bytes(byte for byte, _start in sent).decode() == LINE
    assert [later - earlier for earlier, later in pairwise(written)] == [2000] * (len(LINE) - 1)
    first_edge = enabled[0] + 1
    edges = [first_edge + BIT_TCY * ((at - first_edge) // BIT_TCY + 1) for at in written]
    assert [start for _byte, start in sent] == edges
