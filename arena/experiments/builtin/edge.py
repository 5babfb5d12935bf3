"""Edge following: distance of the last Kilobot from its nearest neighbour, and its rounds about the other Kilobots."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, TrialSamples
from arena.metrics import MetricSeries

BEGIN_S = 15.0
"""Time of the trial from which the distance counts."""

CURVES = [
    Curve("distance", "distance from the nearest robot", "mm", 10),
    Curve("rounds", "rounds about the centre of the others"),
]


def _after(series: MetricSeries, until: float) -> Floats:
    """Return the distances in mm from BEGIN_S on; nan if there are none."""
    part = series.until(until)
    found = 10 * part.curves["distance"][part.times >= BEGIN_S]
    return found if len(found) else np.array([np.nan])


MEASURES = [
    Measure("mean", "mean distance, mm", lambda series, at: float(_after(series, at).mean())),
    Measure("spread", "standard deviation of the distance, mm", lambda series, at: float(_after(series, at).std())),
    Measure("rounds", "rounds after {at:g} s", lambda series, at: series.at(at, "rounds")),
]


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return both metrics of the last robot."""
    others, mover = samples.robots[:, :-1, :2], samples.robots[:, -1, :2]
    nearest = np.hypot(*(others - mover[:, None]).transpose(2, 0, 1)).min(axis=1)
    way = mover - others.mean(axis=1)
    turned = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    return {"distance": nearest, "rounds": np.abs(turned - turned[0]) / (2 * np.pi)}
