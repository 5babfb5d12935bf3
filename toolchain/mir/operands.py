"""Operands of the machine form: registers, numbers, memory, frame slots, file registers and labels.

Registers are ints: 0..15 are W0..W15, larger ones are virtual. A memory operand carries the number of its volatile
access in the source, or 0 if it is not volatile. All words of one access have the same number; two accesses never share
a number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

FIRST_VIRTUAL = 16


@dataclass(frozen=True, slots=True)
class Imm:
    """Literal operand: a number, or an assembler expression such as a symbol or handle(f)."""

    value: int | str

    def __str__(self) -> str:
        return f"#{self.value}"


AddressingMode = Literal["ind", "++", "--", "+", "-", "off", "idx"]


@dataclass(frozen=True, slots=True)
class Mem:
    """Register-indirect operand.

    Modes: "ind" [W], "++" [W++], "--" [W--], "+" [++W], "-" [--W], "off" [W+off], "idx" [W+Wi] (`off` is register i).
    """

    mode: AddressingMode
    base: int
    off: int = 0
    volatile: int = 0


@dataclass(frozen=True, slots=True)
class FrameSlot:
    """Operand in the stack frame: number of the frame object and byte offset in it."""

    index: int
    off: int = 0
    volatile: int = 0


@dataclass(frozen=True, slots=True)
class FileRegister:
    """Directly addressed memory: assembler expression of the address; `near`: it is known to be below 0x2000."""

    expr: str
    near: bool
    volatile: int = 0


Operand = int | Imm | Mem | FrameSlot | FileRegister | str
MEMORY = (Mem, FrameSlot, FileRegister)
STEPPING = ("++", "--", "+", "-")


def operand_text(a: Operand) -> str:
    """Return the text of an operand in a dump."""
    if isinstance(a, int):
        return f"w{a}" if a < FIRST_VIRTUAL else f"v{a}"
    return str(a)
