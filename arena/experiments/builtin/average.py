"""Consensus: how far what robots take for the mean (`mean HUNDREDTHS`) is from the mean of those alive (`value N`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, Moments
from arena.experiments.spoken import alive, last_said, settled_at
from arena.metrics import Course

AGREED = 0.05
"""Chosen: in the scene, any robot that is left out or should be moves the mean by more."""

CURVES = [
    Curve("error", "greatest error of a robot's mean"),
    Curve("typical", "mean error of the robots' means"),
]


def _agreed_at(course: Course, until: float) -> float:
    return settled_at(course.until(until), course.curves["error"] <= AGREED)


MEASURES = [
    Measure("error", "greatest error at {at:g} s", lambda course, at: course.at(at, "error")),
    Measure("agreed", f"s after which no mean is wrong by more than {AGREED:g}", _agreed_at),
]


def all_curves(moments: Moments) -> Mapping[str, Floats]:
    """Errors are those of robots that are alive; nan while one of them has said nothing."""
    means, values, living = last_said(moments, "mean")[0] / 100, last_said(moments, "value")[0], alive(moments)
    worst, typical = np.full((2, len(means)), np.nan)
    for sample, lives in enumerate(living):
        if lives.any():
            errors = np.abs(means[sample, lives] - values[sample, lives].mean())
            worst[sample], typical[sample] = errors.max(), errors.mean()
    return {"error": worst, "typical": typical}
