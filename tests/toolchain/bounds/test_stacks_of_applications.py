"""Stacks and handlers of applications and of random programs, observed at every instruction, never exceed their bounds.

Samples of `python -m bench.stacks` and tests/fuzz/compiler/fuzz_bounds.py; errors planted in the analysis are found.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.stacks import RETURN_ADDRESS, StackRow, rows_of, table
from tests.firmware.conftest import Build, image
from tests.fuzz.compiler.fuzz_bounds import examine
from toolchain.bounds.preserved import PreservedRegisters
from toolchain.bounds.program import Program
from toolchain.bounds.report import Bound, BoundAnalysis
from toolchain.elf.read import read_executable

CYCLES = 900_000
"""Long enough for the first line of listing1's log."""

__all__ = ["image"]


def exceeded(rows: list[StackRow]) -> list[str]:
    return [row.name for row in rows if row.bound is not None and row.seen > row.bound]


@pytest.mark.slow
def test_no_stack_and_no_handler_of_an_application_exceeds_its_bound(
    image: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every stack of listing1 has a bound that covers what is measured; its thread alone needs exactly the bound.

    The thread's deepest call is snprintf, whose assembly shares W9 between its routines. An analysis that assumes all
    routines to preserve W8-W14 states less than the measurement.
    """
    path = image("listing1")
    rows = {row.name: row for row in rows_of("listing1", path, CYCLES)}
    assert not exceeded(list(rows.values()))
    assert all(row.bound is not None for row in rows.values() if row.unit == "bytes"), rows
    alone = rows["loggingThread alone"]
    assert alone.bound == alone.seen == 88 + RETURN_ADDRESS
    assert "| listing1 | `loggingThread alone` | 92 | 92 | bytes | 1.00 |" in table(list(rows.values()))
    monkeypatch.setattr(PreservedRegisters, "changed_by", lambda _self, _entry: frozenset())
    program = Program(read_executable(path.read_bytes(), str(path)))
    planted = BoundAnalysis(program).bound("loggingThread", program.calls.named("loggingThread"), "thread")
    assert RETURN_ADDRESS + planted.bytes < alone.seen


def test_an_unsound_stack_of_a_random_program_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The campaign of random programs finds a stack bound that is two bytes too small."""
    assert examine(2, tmp_path)[0] == "bounded"
    whole = Bound.bytes.fget
    assert whole is not None
    monkeypatch.setattr(Bound, "bytes", property(lambda self: whole(self) - 2))
    with pytest.raises(AssertionError, match="bytes of stack, bound"):
        examine(2, tmp_path)
