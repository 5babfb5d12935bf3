"""The bundles of the published experiment verify with the present emulator and arena."""

from __future__ import annotations

from pathlib import Path

import pytest

from arena.campaign import bundle

RESULTS = Path(__file__).parents[3] / "docs/results"


@pytest.mark.slow
def test_a_trial_of_each_brain_begins_as_recorded() -> None:
    """The first 60 s of trial 1 of the OpenSwarm and of the bare run have the recorded values, with the firmware in the
    bundle."""
    found = list(bundle.verify(RESULTS / "clustering.zip", lambda numbers: numbers[:1], beginning=True))
    assert {one.run for one in found} >= {"openswarm-A", "bare-A"}
    assert [(one.run, one.number, one.differs) for one in found if not one.equal] == []
