"""A shared search: how many parts robots know to be done (`done N`), who knows all and the right answer (`best N`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, Moments
from arena.experiments.spoken import alive, last_said, settled_at
from arena.metrics import Course

PARTS = 32
ANSWER = 52_527
"""Of all numbers below 2^16 it takes the most steps to 1, 339 (OEIS A006877 and A006878)."""

CURVES = [
    Curve("done", "parts that a robot knows to be done, mean", "%", 100, 1.0),
    Curve("right", "robots that know all parts to be done, and the right answer", "%", 100, 1.0),
]


def _found(course: Course, until: float) -> float:
    return settled_at(course.until(until), course.curves["right"] == 1.0)


MEASURES = [
    Measure("right", "share that knows the answer at {at:g} s", lambda course, at: course.at(at, "right")),
    Measure("found", "s after which all that live know the answer", _found),
]


def all_curves(moments: Moments) -> Mapping[str, Floats]:
    """Of the robots that are alive."""
    done, best, living = last_said(moments, "done")[0], last_said(moments, "best")[0], alive(moments)
    count = np.maximum(living.sum(axis=1), 1)
    shares = np.where(living, np.nan_to_num(done), 0).sum(axis=1) / PARTS / count
    right = (living & (done == PARTS) & (best == ANSWER)).sum(axis=1) / count
    return {"done": shares, "right": right}
