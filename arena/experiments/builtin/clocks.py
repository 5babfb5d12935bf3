"""Clock synchronisation: time that robots report (`clock MS`) against the simulated time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, TrialSamples
from arena.experiments.uart_values import alive, apart, last_values, settled_at
from arena.metrics import MetricSeries

AGREED_MS = 20.0
"""Chosen tolerance: a fifth of the duration of a message."""

CURVES = [
    Curve("apart", "greatest difference between two clocks", "ms"),
    Curve("drift", "mean of the clocks less true time, since they agree for good", "ms"),
]


def _agreed_at(series: MetricSeries, until: float) -> float:
    return settled_at(series.until(until), series.curves["apart"] <= AGREED_MS)


MEASURES = [
    Measure("apart", "greatest difference of clocks at {at:g} s, ms", lambda series, at: series.at(at, "apart")),
    Measure("drift", "clocks less true time at {at:g} s, ms", lambda series, at: series.at(at, "drift")),
    Measure("agreed", f"s after which all stayed within {AGREED_MS:g} ms", _agreed_at),
]


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return range and drift of the clocks; the offset of a clock is known at a report and held until the next one."""
    clocks, seconds = last_values(samples, "clock")
    leads, living = clocks - 1000 * seconds, alive(samples)
    differ = apart(leads, living)
    sums, count = np.where(living, leads, 0.0).sum(axis=1), np.maximum(living.sum(axis=1), 1)
    means = sums / count
    # Before the clocks agree, a robot may have a better time than the one that it has reported last.
    apart_at = np.flatnonzero(~(differ <= AGREED_MS))
    begin = int(apart_at[-1]) + 1 if len(apart_at) else 0
    drift = np.full(len(means), np.nan)
    drift[begin:] = means[begin:] - means[begin : begin + 1]
    return {"apart": differ, "drift": drift}
