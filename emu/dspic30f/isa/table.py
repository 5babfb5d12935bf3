"""The instruction table: all rows, accessible by opcode byte and by mnemonic."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from emu.dspic30f.isa.rows import bit, compare, control, dsp, flow, logic, math, move, multiply, shift, stack

from .row import Row

GROUPS = (
    move,
    math,
    multiply,
    logic,
    shift,
    bit,
    compare,
    flow,
    stack,
    control,
    dsp,
)

ROWS: Final[tuple[Row, ...]] = tuple(sorted((row for group in GROUPS for row in group.ROWS), key=lambda row: row.id))
BY_ID: Final[Mapping[int, Row]] = {row.id: row for row in ROWS}


def _by_opcode_byte() -> tuple[tuple[Row, ...], ...]:
    """Return, for each value of bits 23:16, the rows whose pattern allows it."""
    buckets: list[list[Row]] = [[] for _ in range(256)]
    for row in ROWS:
        mask, value = row.pattern.mask[0] >> 16, row.pattern.value[0] >> 16
        for byte in range(256):
            if byte & mask == value:
                buckets[byte].append(row)
    return tuple(map(tuple, buckets))


BY_BYTE: Final = _by_opcode_byte()
