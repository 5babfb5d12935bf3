"""A sample of the fuzz campaign `tests/fuzz/fuzz_run.py`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "fuzz"))

from fuzz_run import campaign


def test_damaged_firmware_ends_with_a_reason_and_nothing_else():
    outcomes = campaign(range(2016, 2106), ("plain", "jit"))
    assert sum(outcomes.values()) == 90
    assert outcomes["fault"] > 20
    assert outcomes["limit"] > 10
