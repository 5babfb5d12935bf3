"""Consensus: error of the mean that robots report (`mean HUNDREDTHS`) against the mean of their values (`value N`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, TrialSamples
from arena.experiments.uart_values import alive, last_values, settled_at
from arena.metrics import MetricSeries

AGREED = 0.05
"""Chosen tolerance. In the scene, a mean that counts one robot too many or too few is off by more."""

CURVES = [
    Curve("error", "greatest error of a robot's mean"),
    Curve("typical", "mean error of the robots' means"),
]


def _agreed_at(series: MetricSeries, until: float) -> float:
    return settled_at(series.until(until), series.curves["error"] <= AGREED)


MEASURES = [
    Measure("error", "greatest error at {at:g} s", lambda series, at: series.at(at, "error")),
    Measure("agreed", f"s after which no mean is wrong by more than {AGREED:g}", _agreed_at),
]


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return the greatest and the mean error over the powered-on robots; nan before all have reported."""
    means, values, living = last_values(samples, "mean")[0] / 100, last_values(samples, "value")[0], alive(samples)
    worst, typical = np.full((2, len(means)), np.nan)
    for sample, lives in enumerate(living):
        if lives.any():
            errors = np.abs(means[sample, lives] - values[sample, lives].mean())
            worst[sample], typical[sample] = errors.max(), errors.mean()
    return {"error": worst, "typical": typical}
