"""Engines agree on random code; `make campaigns` runs the long version (tests/fuzz/emulator/fuzz_engines.py)."""

from __future__ import annotations

import pytest

from emu.dspic30f.isa.table import ROWS
from tests.emu.cpu.engine_fuzz import check_pairs, check_programs


@pytest.mark.slow
def test_every_row_gives_the_same_state_in_random_contexts(other: str) -> None:
    """engines.md §4.2: every row gives the same registers, memory, SR, hidden state and cycle in random contexts,
    also under REPEAT."""
    assert check_pairs(0, len(ROWS), 2, other) == 2 * len(ROWS)


@pytest.mark.slow
def test_random_programs_give_the_same_state_at_random_cycles(other: str) -> None:
    """engines.md §4.2: random programs with loops, calls, skips, REPEAT, DO, critical sections, timer interrupts and
    traps have the same state at random cycles."""
    assert check_programs(0, 15, other) > 0
