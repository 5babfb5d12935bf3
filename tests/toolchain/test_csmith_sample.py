"""Thirty programs of the csmith campaign (`tests/fuzz/csmith_campaign.py`, which `make campaigns` runs at length)."""

from __future__ import annotations

import pytest

from tests.fuzz.csmith_campaign import available, examine

FIRST_SEED, COUNT = 9000, 30


@pytest.mark.skipif(not available(), reason="csmith is not installed (Debian package csmith)")
@pytest.mark.parametrize("seed", range(FIRST_SEED, FIRST_SEED + COUNT))
def test_random_program_gives_one_checksum_at_every_level(seed: int) -> None:
    """Issue B, csmith campaign: -O0 and -Os agree, and agree with avr-gcc on simavr where installed."""
    verdict = examine(seed)
    if verdict.kind == "skipped":
        pytest.skip(verdict.reason)
    assert verdict.kind == "agreed", verdict.reason
