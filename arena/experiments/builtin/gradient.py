"""Gradient: share of the Kilobots that show their true hop count from the first robot, and when all do."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from arena.experiments import Curve, Floats, Measure, TrialSamples

HOP_COLOURS = (1, 5, 4, 20, 16, 17)
"""LEDs of the hop counts 0 to 5 in firmware/kilobot/programs/gradient.c; then they repeat."""
RUN_S = 0.7
"""Time of the trial at which all robots have received RUN."""

CURVES = [
    Curve("correct", "robots that show their hop count", "%", 100, 1.0),
    Curve("hops", "longest shortest path", "hops"),
]


def true_hops(places: Floats, reach_cm: float) -> NDArray[np.int64]:
    """Return the hops of each robot from robot 0 over distances up to `reach_cm`; -1: no path."""
    if not len(places):
        return np.zeros(0, dtype=np.int64)
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import shortest_path

    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    hops = shortest_path(csr_array(apart <= reach_cm), unweighted=True, indices=0)
    return np.where(np.isfinite(hops), hops, -1).astype(np.int64)


MEASURES = [
    Measure("settled", "s from RUN until all show their hop count",
            lambda series, at: series.until(at).first("correct", 1.0) - RUN_S),
    Measure("per_hop", "s per hop of the longest path",
            lambda series, at: (series.until(at).first("correct", 1.0) - RUN_S) / series.last("hops")),
]  # fmt: skip


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return both metrics; for a robot without a path, a dark LED counts as correct."""
    shown = samples.led_states()
    correct, longest = [], []
    for sample, robots in enumerate(samples.robots):
        hops = true_hops(robots[:, :2], samples.scene.kilobots.reach_cm)
        wanted = np.where(hops < 0, 0, np.array(HOP_COLOURS)[hops % len(HOP_COLOURS)])
        correct.append(float((shown[sample] == wanted).mean()) if len(hops) else 1.0)
        longest.append(float(hops.max(initial=0)))
    return {"correct": np.array(correct), "hops": np.array(longest)}
