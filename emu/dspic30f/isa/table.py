"""The table: all rows, found by opcode byte or by mnemonic."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from . import (
    rows_bit,
    rows_compare,
    rows_control,
    rows_dsp,
    rows_flow,
    rows_logic,
    rows_math,
    rows_move,
    rows_multiply,
    rows_shift,
    rows_stack,
)
from .row import Row

GROUPS = (
    rows_move,
    rows_math,
    rows_multiply,
    rows_logic,
    rows_shift,
    rows_bit,
    rows_compare,
    rows_flow,
    rows_stack,
    rows_control,
    rows_dsp,
)

ROWS: Final[tuple[Row, ...]] = tuple(sorted((row for group in GROUPS for row in group.ROWS), key=lambda row: row.id))
BY_ID: Final[Mapping[int, Row]] = {row.id: row for row in ROWS}


def _by_opcode_byte() -> tuple[tuple[Row, ...], ...]:
    """For each value of bits 23:16, the rows whose pattern allows it."""
    buckets: list[list[Row]] = [[] for _ in range(256)]
    for row in ROWS:
        mask, value = row.pattern.mask[0] >> 16, row.pattern.value[0] >> 16
        for byte in range(256):
            if byte & mask == value:
                buckets[byte].append(row)
    return tuple(map(tuple, buckets))


BY_BYTE: Final = _by_opcode_byte()
