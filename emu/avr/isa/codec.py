"""Decoder of AVR program words. Input: one or two words. Output: an instruction, or None for an illegal word."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final

from emu.avr.isa.row import Row
from emu.avr.isa.rows import ERASED, ERASED_BITS, ROWS

_GROUPS: Final[Mapping[int, tuple[Row, ...]]] = {
    top: tuple(row for row in ROWS if not (top << 12 ^ row.match) & row.mask & 0xF000) for top in range(16)
}
"""Rows by the first four bits of a word."""


@dataclass(frozen=True, slots=True)
class Insn:
    """One instruction: its row and its operands by name."""

    row: Row
    operands: Mapping[str, int]


@cache
def row_of(word: int) -> Row | None:
    """Return the row of a first word, None if it is no instruction. A word of erased flash is no instruction."""
    return next((row for row in _GROUPS[word >> 12] if word & row.mask == row.match), None)


def decode(word: int, second: int = 0) -> Insn | None:
    """Return the instruction that starts with `word`, as the CPU executes it; None if it is illegal."""
    if word == ERASED:
        word = ERASED_BITS
    row = row_of(word)
    return None if row is None else Insn(row, row.operands(word, second))
