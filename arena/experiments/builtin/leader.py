"""Leader election: share of the robots that follow the same living robot (`leader RANK`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, TrialSamples
from arena.experiments.uart_values import alive, last_values, settled_at
from arena.metrics import MetricSeries

CURVES = [
    Curve("following", "robots that follow the leader most of them follow, if it is alive", "%", 100, 1.0),
    Curve("leaders", "robots that take themselves for the leader"),
]
ALL = 1.0


def _elected(series: MetricSeries, until: float) -> float:
    return settled_at(series.until(until), series.curves["following"] >= ALL)


MEASURES = [
    Measure("following", "share behind one leader at {at:g} s", lambda series, at: series.at(at, "following")),
    Measure("elected", "s after which all follow one living leader until {at:g} s", _elected),
]


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return both metrics; the leader is identified by the rank that it last reported (`rank N`)."""
    said, _ = last_values(samples, "leader")
    all_ranks, _ = last_values(samples, "rank")
    living = alive(samples)
    following, leaders = np.zeros(len(said)), np.zeros(len(said))
    for sample, (names, ranks, lives) in enumerate(zip(said, all_ranks, living, strict=True)):
        here = {ranks[robot] for robot in np.flatnonzero(lives)}
        votes = [float(name) for name in names[lives] if name in here]
        most = max((votes.count(one) for one in votes), default=0)
        following[sample] = most / max(int(lives.sum()), 1)
        leaders[sample] = sum(name == rank for name, rank in zip(names[lives], ranks[lives], strict=True))
    return {"following": following, "leaders": leaders}
