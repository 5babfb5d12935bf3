"""Object clustering (docs/experiment.md): share of the objects in the largest cluster, and compactness."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, TrialSamples
from arena.metrics import MetricSeries, clusters, compactnesses, largest_shares, reach_of
from arena.scene.loader import Scene

PUBLISHED = "86.5 % after 600 s: ten trials with real robots, reported for ref. [10], not for either run here"
CURVES = [
    Curve(
        "share", "objects in the largest cluster", "%", 100, 1.0, (0.865, "86.5 % of ref. [10] at 600 s, real robots")
    ),
    Curve("share_12cm", "the same, 12 cm rule", "%", 100, 1.0),
    Curve("compactness", "compactness u, Eq. (2)"),
]
MARGIN = 0.10
"""Margin of equivalence: 10 percentage points (experiment-contract.md §5)."""


def _until_80(series: MetricSeries, _at: float) -> float:
    reached = series.first("share", 0.8)
    return float(series.times[-1]) if np.isnan(reached) else reached


MEASURES = [
    Measure("share", "share at {at:g} s", lambda one, at: one.at(at, "share"), MARGIN, 1.0),
    Measure("share_12cm", "share at {at:g} s, 12 cm rule", lambda one, at: one.at(at, "share_12cm"), MARGIN, 1.0),
    Measure("area", "mean compactness", lambda one, _at: one.mean("compactness")),
    Measure("t80", "time to 80 % (s, the end if never)", _until_80),
]


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return all metrics at every sample."""
    objects = samples.scene.objects
    return {
        "share": largest_shares(samples.objects, reach_of("4r", objects.radius_cm)),
        "share_12cm": largest_shares(samples.objects, reach_of("12cm", objects.radius_cm)),
        "compactness": compactnesses(samples.objects, objects.radius_cm),
    }


def groups(scene: Scene, objects: Floats) -> list[int]:
    """Return the cluster number of each object."""
    return clusters(objects, reach_of("4r", scene.objects.radius_cm))
