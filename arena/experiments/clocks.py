"""Clocks that agree: what robots that are alive take for the time (`clock MS`) against the arena's true time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, Moments
from arena.experiments._spoken import alive, apart, last_said, settled_at
from arena.metrics import Course

AGREED_MS = 20.0
"""Chosen: a fifth of the time a message takes."""

CURVES = [
    Curve("apart", "greatest difference between two clocks", "ms"),
    Curve("drift", "mean of the clocks less true time, since they first agreed", "ms"),
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
    agreed = np.flatnonzero(differ <= AGREED_MS)
    begin = means[agreed[0]] if len(agreed) else np.nan
    drift = np.where(np.arange(len(means)) >= (agreed[0] if len(agreed) else 0), means - begin, np.nan)
    return {"apart": differ, "drift": drift}
