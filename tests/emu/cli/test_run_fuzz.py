"""A sample of the fuzz campaign `tests/fuzz/emulator/fuzz_run.py`."""

from __future__ import annotations

from tests.fuzz.emulator.fuzz_run import campaign


def test_damaged_firmware_ends_with_a_reason_and_nothing_else():
    outcomes = campaign(range(2016, 2106), ("plain", "jit"))
    assert sum(outcomes.values()) == 90
    assert outcomes["fault"] > 20
    assert outcomes["limit"] > 10
