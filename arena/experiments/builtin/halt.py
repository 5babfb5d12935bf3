"""Simultaneous stop: share of the robots that have stopped, and time between the first and the last stop."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, TrialSamples
from arena.experiments.uart_values import alive, apart, last_values
from arena.metrics import MetricSeries

STILL_CM, STILL_RAD = 0.1, 0.04
"""Motion per sample that counts as rest; a robot drives 0.4 cm or turns 0.15 rad in 0.1 s."""
TOGETHER_S = 1.0

CURVES = [
    Curve("standing", "robots that have stopped for good", "%", 100, 1.0),
    Curve("between", "from the first stop to the last", "s"),
]


def _together(series: MetricSeries, until: float) -> float:
    """Return the seconds between first and last stop; nan unless all have stopped within `TOGETHER_S`."""
    between = series.at(until, "between")
    return between if between <= TOGETHER_S else float("nan")


MEASURES = [
    Measure("standing", "share that stands at {at:g} s", lambda series, at: series.at(at, "standing")),
    Measure("together", f"s between first and last stop, if all stopped within {TOGETHER_S:g} s", _together),
]


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return both metrics; a robot has stopped if it has reported it (`halt MS`) and is at rest."""
    _, halted = last_values(samples, "halt")
    steps = np.abs(np.diff(samples.robots, axis=0, prepend=samples.robots[:1]))
    moves = (np.hypot(steps[:, :, 0], steps[:, :, 1]) > STILL_CM) | (steps[:, :, 2] > STILL_RAD)
    stopped = ~np.isnan(halted) & ~moves
    living = alive(samples)
    share = (stopped & living).sum(axis=1) / np.maximum(living.sum(axis=1), 1)
    between = np.where(share == 1.0, apart(halted, living), np.nan)
    return {"standing": share, "between": between}
