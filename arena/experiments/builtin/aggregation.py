"""Aggregation: how near to each other robots have come, and how many belong to the largest group."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Moments
from arena.metrics import compactnesses, largest_shares
from arena.scene import dimensions

CURVES = [
    Curve("cluster", "robots in the largest group", "%", 100, 1.0),
    Curve("dispersion", "dispersion of the robots, sum of squared distances to their centre / 4 r²"),
]
REACH_CM = 4 * dimensions.ROBOT_RADIUS
"""Robots nearer than this belong together: no other fits between them, as for objects (epuck.md §8)."""


def all_curves(moments: Moments) -> Mapping[str, Floats]:
    """Both at every sample; the dispersion is Eq. (2) of the clustering experiment, of robots."""
    places = np.ascontiguousarray(moments.robots[:, :, :2])
    return {"cluster": largest_shares(places, REACH_CM), "dispersion": compactnesses(places, dimensions.ROBOT_RADIUS)}
