"""Clocks that agree: what robots that are alive take for the time (`clock MS`) against the arena's true time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, Moments
from arena.experiments.spoken import alive, apart, last_said, settled_at
from arena.metrics import Course

AGREED_MS = 20.0
"""Chosen: a fifth of the time a message takes."""

CURVES = [
    Curve("apart", "greatest difference between two clocks", "ms"),
    Curve("drift", "mean of the clocks less true time, since they agree for good", "ms"),
]


def _agreed_at(course: Course, until: float) -> float:
    return settled_at(course.until(until), course.curves["apart"] <= AGREED_MS)


MEASURES = [
    Measure("apart", "greatest difference of clocks at {at:g} s, ms", lambda course, at: course.at(at, "apart")),
    Measure("drift", "clocks less true time at {at:g} s, ms", lambda course, at: course.at(at, "drift")),
    Measure("agreed", f"s after which all stayed within {AGREED_MS:g} ms", _agreed_at),
]


def all_curves(moments: Moments) -> Mapping[str, Floats]:
    """Each clock's lead on the arena's time is known when it is said, and holds until it is said again."""
    clocks, seconds = last_said(moments, "clock")
    leads, living = clocks - 1000 * seconds, alive(moments)
    differ = apart(leads, living)
    sums, count = np.where(living, leads, 0.0).sum(axis=1), np.maximum(living.sum(axis=1), 1)
    means = sums / count
    apart_at = np.flatnonzero(~(differ <= AGREED_MS))  # until then somebody may know better and not have said so
    begin = int(apart_at[-1]) + 1 if len(apart_at) else 0
    drift = np.full(len(means), np.nan)
    drift[begin:] = means[begin:] - means[begin : begin + 1]
    return {"apart": differ, "drift": drift}
