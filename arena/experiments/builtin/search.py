"""Shared search of a number range: parts known to be searched (`done N`), robots with the right answer (`best N`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, TrialSamples
from arena.experiments.uart_values import alive, last_values, settled_at
from arena.metrics import MetricSeries

PARTS = 32
ANSWER = 52_527
"""Number below 2^16 with the most Collatz steps to 1, which are 339 (OEIS A006877 and A006878)."""

CURVES = [
    Curve("done", "parts that a robot knows to be done, mean", "%", 100, 1.0),
    Curve("right", "robots that know all parts to be done, and the right answer", "%", 100, 1.0),
]


def _found(series: MetricSeries, until: float) -> float:
    return settled_at(series.until(until), series.curves["right"] == 1.0)


MEASURES = [
    Measure("right", "share that knows the answer at {at:g} s", lambda series, at: series.at(at, "right")),
    Measure("found", "s after which all that live know the answer", _found),
]


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return two shares over the powered-on robots: mean share of parts `done`; robots with the answer, `right`."""
    done, best, living = last_values(samples, "done")[0], last_values(samples, "best")[0], alive(samples)
    count = np.maximum(living.sum(axis=1), 1)
    shares = np.where(living, np.nan_to_num(done), 0).sum(axis=1) / PARTS / count
    right = (living & (done == PARTS) & (best == ANSWER)).sum(axis=1) / count
    return {"done": shares, "right": right}
