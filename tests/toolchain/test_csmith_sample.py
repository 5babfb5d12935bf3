"""A sample of the csmith campaign (`tests/fuzz/compiler/fuzz_csmith.py`)."""

from __future__ import annotations

import pytest

from tests.fuzz.compiler.fuzz_csmith import SHAPES, available, examine

SEEDS = [seed for seed in range(9000, 9014) if seed not in (9001, 9012)]
"""Seeds 9000-9013 without two whose programs run for more than 15,000,000 cycles at -O0."""


@pytest.mark.slow
@pytest.mark.skipif(not available(), reason="csmith is not installed (Debian package csmith)")
@pytest.mark.parametrize("seed", SEEDS)
def test_random_program_gives_one_checksum_at_every_level(seed: int) -> None:
    """A random program has the same checksum at -O0, at another level, and with avr-gcc on simavr if installed."""
    verdict = examine(seed, shapes=(SHAPES[0], SHAPES[1 + seed % (len(SHAPES) - 1)]))
    if verdict.kind == "skipped":
        pytest.skip(verdict.reason)
    assert verdict.kind == "agreed", verdict.reason
