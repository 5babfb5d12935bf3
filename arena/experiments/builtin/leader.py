"""Election: how many robots that are alive follow the same robot (`leader RANK`), and it is alive."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, Moments
from arena.experiments.spoken import alive, last_said, settled_at
from arena.metrics import Course

CURVES = [
    Curve("following", "robots that follow the leader most of them follow, if it is alive", "%", 100, 1.0),
    Curve("leaders", "robots that take themselves for the leader"),
]
EVERYBODY = 1.0


def _elected(course: Course, until: float) -> float:
    return settled_at(course.until(until), course.curves["following"] >= EVERYBODY)


MEASURES = [
    Measure("following", "share behind one leader at {at:g} s", lambda course, at: course.at(at, "following")),
    Measure("elected", "s after which all follow one living leader until {at:g} s", _elected),
]


def all_curves(moments: Moments) -> Mapping[str, Floats]:
    """A leader is known by the rank it says it has (`rank N`); a rank that is said later replaces the one before."""
    said, _ = last_said(moments, "leader")
    all_ranks, _ = last_said(moments, "rank")
    living = alive(moments)
    following, leaders = np.zeros(len(said)), np.zeros(len(said))
    for sample, (names, ranks, lives) in enumerate(zip(said, all_ranks, living, strict=True)):
        here = {ranks[robot] for robot in np.flatnonzero(lives)}
        votes = [float(name) for name in names[lives] if name in here]
        most = max((votes.count(one) for one in votes), default=0)
        following[sample] = most / max(int(lives.sum()), 1)
        leaders[sample] = sum(name == rank for name, rank in zip(names[lives], ranks[lives], strict=True))
    return {"following": following, "leaders": leaders}
