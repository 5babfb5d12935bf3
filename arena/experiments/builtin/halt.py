"""Stopping together: how many robots that are alive stand still as they were told, and how long after the first."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, Moments
from arena.experiments.spoken import alive, apart, last_said
from arena.metrics import Course

STILL_CM, STILL_RAD = 0.1, 0.04
"""Per sample: chosen far below what a robot drives or turns in 0.1 s (0.4 cm, 0.15 rad)."""
TOGETHER_S = 1.0

CURVES = [
    Curve("standing", "robots that have stopped for good", "%", 100, 1.0),
    Curve("between", "from the first stop to the last", "s"),
]


def _together(course: Course, until: float) -> float:
    """Seconds between the first stop and the last; nan unless all stand, within `TOGETHER_S`."""
    between = course.at(until, "between")
    return between if between <= TOGETHER_S else float("nan")


MEASURES = [
    Measure("standing", "share that stands at {at:g} s", lambda course, at: course.at(at, "standing")),
    Measure("together", f"s between first and last stop, if all stopped within {TOGETHER_S:g} s", _together),
]


def all_curves(moments: Moments) -> Mapping[str, Floats]:
    """A robot has stopped if it says so (`halt MS`) and stands since the sample before."""
    _, halted = last_said(moments, "halt")
    steps = np.abs(np.diff(moments.robots, axis=0, prepend=moments.robots[:1]))
    moves = (np.hypot(steps[:, :, 0], steps[:, :, 1]) > STILL_CM) | (steps[:, :, 2] > STILL_RAD)
    stands = ~np.isnan(halted) & ~moves
    living = alive(moments)
    share = (stands & living).sum(axis=1) / np.maximum(living.sum(axis=1), 1)
    between = np.where(share == 1.0, apart(halted, living), np.nan)
    return {"standing": share, "between": between}
