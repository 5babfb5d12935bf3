"""A sample of tests/fuzz/swarm/fuzz_swarm.py: random swarms are equal in all modes of lock-step."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from tests.fuzz.swarm import fuzz_swarm
from tests.fuzz.swarm.fuzz_swarm import EXPECTED, Trial, check


def test_random_swarms_are_equal_in_all_modes(tmp_path: Path) -> None:
    """Quantum after quantum, in Python, and in native code. Three trials reach nearly all counters of the campaign."""
    tally = Counter[str]()
    for seed in (5, 104, 105):
        assert check(Trial(seed, tmp_path), tally) is None
    missing = [what for what in EXPECTED if not tally[what]]
    assert set(missing) <= {"robots away", "turns of other threads", "robots that measure light"}


def test_the_campaign_detects_a_difference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Registers, bodies and records are compared. Pushing one robot in one of the modes is a difference."""
    trial, run = Trial(104, tmp_path), Trial.run

    def pushed(self: Trial, way: str, tally: Counter[str]) -> list[list[object]]:
        seen = run(self, way, tally)
        if way == "1 thread":
            seen[-1][-1][0] += 1e-9
        return seen

    monkeypatch.setattr(fuzz_swarm.Trial, "run", pushed)
    assert "1 thread" in (check(trial, Counter()) or "")
