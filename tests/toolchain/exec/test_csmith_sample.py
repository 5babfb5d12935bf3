"""A sample of the csmith campaign (`tests/fuzz/compiler/fuzz_csmith.py`)."""

from __future__ import annotations

import random

import pytest

from tests.cases import check_all
from tests.fuzz.compiler.fuzz_csmith import SHAPES, available, examine
from tests.fuzz.seeds import base_seed

SEEDS = [seed for seed in range(9000, 9014) if seed not in (9001, 9012)]
"""Seeds 9000-9013 without two whose programs run for more than 15,000,000 cycles at -O0."""


@pytest.mark.slow
@pytest.mark.skipif(not available(), reason="csmith is not installed (Debian package csmith)")
def test_random_programs_give_one_checksum_at_every_level() -> None:
    """A random program has the same checksum at -O0, at another level, and with avr-gcc on simavr if installed.

    The commit determines which half of the seeds is tried.
    """

    def check(seed: int) -> None:
        verdict = examine(seed, shapes=(SHAPES[0], SHAPES[1 + seed % (len(SHAPES) - 1)]))
        assert verdict.kind in ("agreed", "skipped"), verdict.reason

    check_all(check, random.Random(base_seed()).sample(SEEDS, len(SEEDS) // 2))
