"""Orbit: distance of the planet from the star, and the rounds it has made."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, TrialSamples
from arena.metrics import MetricSeries

BEGIN_S = 10.0
"""Time of the trial from which the distance counts. Before, the planet receives RUN and turns into its orbit."""

CURVES = [
    Curve("distance", "distance of the planet", "mm", 10, reference=(6.0, "60 mm (Kilobotics, lab 4)")),
    Curve("rounds", "rounds around the star", "", reference=(5.0, "5 rounds (Rubenstein et al. 2012)")),
]


def _after(series: MetricSeries, until: float) -> Floats:
    """Return the distances in mm from BEGIN_S on."""
    part = series.until(until)
    return 10 * part.curves["distance"][part.times >= BEGIN_S]


def _mean(series: MetricSeries, until: float) -> float:
    found = _after(series, until)
    return float(found.mean()) if len(found) else float("nan")


def _spread(series: MetricSeries, until: float) -> float:
    found = _after(series, until)
    return float(found.std()) if len(found) else float("nan")


MEASURES = [
    Measure("mean", "mean distance, mm", _mean),
    Measure("spread", "standard deviation of the distance, mm", _spread),
    Measure("rounds", "rounds after {at:g} s", lambda series, at: series.at(at, "rounds")),
]


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return both metrics; robot 0 is the star, robot 1 the planet."""
    way = samples.robots[:, 1, :2] - samples.robots[:, 0, :2]
    turned = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    return {"distance": np.hypot(way[:, 0], way[:, 1]), "rounds": np.abs(turned - turned[0]) / (2 * np.pi)}
