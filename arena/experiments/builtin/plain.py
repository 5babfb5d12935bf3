"""Default experiment: distance between the robots, and distance travelled."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, TrialSamples

CURVES = [
    Curve("spread", "mean distance of the robots from their centre", "cm"),
    Curve("travelled", "way of a robot so far, mean", "cm"),
]


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return both metrics at every sample; the path between two samples counts as a straight line."""
    places = samples.robots[:, :, :2]
    if not places.shape[1]:
        return {"spread": np.zeros(len(places)), "travelled": np.zeros(len(places))}
    away = np.sqrt(((places - places.mean(axis=1, keepdims=True)) ** 2).sum(axis=2)).mean(axis=1)
    steps = np.sqrt((np.diff(places, axis=0) ** 2).sum(axis=2)).mean(axis=1)
    return {"spread": away, "travelled": np.concatenate([[0.0], np.cumsum(steps)])}
