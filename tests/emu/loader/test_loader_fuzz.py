"""A sample of the fuzz campaign `tests/fuzz/emulator/fuzz_loader.py`."""

from __future__ import annotations

from tests.fuzz.emulator.fuzz_loader import campaign


def test_mutated_files_are_loaded_or_refused_and_nothing_else_happens():
    outcomes = campaign(range(20160, 21660))
    assert sum(outcomes.values()) == 1500
    assert outcomes["refused"] > 100
    assert outcomes["loaded"] > 100
