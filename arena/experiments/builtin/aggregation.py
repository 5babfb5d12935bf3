"""Aggregation: share of the robots in the largest group, and dispersion of the robots."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, TrialSamples
from arena.metrics import compactnesses, largest_shares
from arena.scene import dimensions

CURVES = [
    Curve("cluster", "robots in the largest group", "%", 100, 1.0,
          (0.986, "98.6 % of 40 e-pucks, 30 trials (Gauci et al. 2014)")),
    Curve("dispersion", "dispersion of the robots, sum of squared distances to their centre / 4 r²"),
]
REACH_CM = 4 * dimensions.ROBOT_RADIUS
"""Centre distance below which two robots are adjacent: no other robot fits between them (epuck.md §8)."""


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return both metrics at every sample; the dispersion is Eq. (2) of the clustering experiment, for robots."""
    places = np.ascontiguousarray(samples.robots[:, :, :2])
    return {"cluster": largest_shares(places, REACH_CM), "dispersion": compactnesses(places, dimensions.ROBOT_RADIUS)}
