"""A sample of the fuzz campaign `tests/fuzz/fuzz_loader.py`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "fuzz"))

from fuzz_loader import campaign


def test_mutated_files_are_loaded_or_refused_and_nothing_else_happens():
    outcomes = campaign(range(20160, 21660))
    assert sum(outcomes.values()) == 1500
    assert outcomes["refused"] > 100
    assert outcomes["loaded"] > 100
