"""A sample of tests/fuzz/swarm/fuzz_swarm.py: random swarms give equal results in all modes of lock-step."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from tests.fuzz.swarm import fuzz_swarm
from tests.fuzz.swarm.fuzz_swarm import EXPECTED, Trial, check


@pytest.mark.slow
def test_random_swarms_are_equal_in_all_modes(tmp_path: Path) -> None:
    """Single quanta, lock-step in Python and native lock-step give equal results. Three trials reach nearly all
    counters of the campaign."""
    tally = Counter[str]()
    for seed in (9, 14, 26):
        assert check(Trial(seed, tmp_path), tally) is None
    missing = [what for what in EXPECTED if not tally[what]]
    assert set(missing) <= {"robots away", "turns of other threads", "robots that measure light"}


def test_the_campaign_detects_a_difference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The campaign reports a difference if one robot is pushed in one of the modes, because registers, bodies and
    records are compared."""
    trial, run = Trial(104, tmp_path), Trial.run

    def pushed(self: Trial, mode: str, tally: Counter[str]) -> list[list[object]]:
        seen = run(self, mode, tally)
        if mode == "1 thread":
            seen[-1][-1][0] += 1e-9
        return seen

    monkeypatch.setattr(fuzz_swarm.Trial, "run", pushed)
    assert "1 thread" in (check(trial, Counter()) or "")
