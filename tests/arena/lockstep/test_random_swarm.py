"""A sample of tests/fuzz/swarm/fuzz_swarm.py: a swarm of random robots is the same however it is run."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from tests.fuzz.swarm import fuzz_swarm
from tests.fuzz.swarm.fuzz_swarm import EXPECTED, Trial, check


def test_swarms_of_random_robots_are_the_same_in_every_way(tmp_path: Path) -> None:
    """Quantum after quantum, by Python, in compiled code; three trials show nearly all that the campaign is to show."""
    tally = Counter[str]()
    for seed in (5, 104, 105):
        assert check(Trial(seed, tmp_path), tally) is None
    missing = [what for what in EXPECTED if not tally[what]]
    assert set(missing) <= {"robots away", "turns of other threads", "robots that measure light"}


def test_a_difference_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Registers, bodies and records are compared: one robot that is pushed in one of the ways is enough."""
    trial, run = Trial(104, tmp_path), Trial.run

    def pushed(self: Trial, way: str, tally: Counter[str]) -> list[list[object]]:
        seen = run(self, way, tally)
        if way == "1 thread":
            seen[-1][-1][0] += 1e-9
        return seen

    monkeypatch.setattr(fuzz_swarm.Trial, "run", pushed)
    assert "1 thread" in (check(trial, Counter()) or "")
