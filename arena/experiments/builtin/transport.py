"""Cooperative transport: distance of the first object from the goal, and its path (Chen et al., IEEE T-RO 31, 2015).

The goal is the round obstacle called `goal`. A trial ends when the circle around the object touches it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from arena.experiments import Curve, Floats, Measure, TrialSamples
from arena.experiments.supervisor import Supervisor
from arena.metrics import MetricSeries
from arena.scene.loader import Scene, SceneError

CURVES = [
    Curve("distance", "distance of the object from the goal", "cm", 1, 0.0),
    Curve("path", "path of the object", "cm"),
]
PUBLISHED = "43 of 45 trials with 20 e-pucks and three objects reached the goal"
_JITTER_CM = 0.05
"""Movements of an object between two samples below this length do not count as path."""


def _arrival(series: MetricSeries, until: float) -> float:
    """Return the time of arrival in s; nan if the object has not arrived."""
    part = series.until(until)
    there = np.flatnonzero(part.curves["distance"] <= 0)
    return float(part.times[there[0]]) if len(there) else math.nan


def _efficiency(series: MetricSeries, until: float) -> float:
    """Return by how much the object has come closer to the goal, as a share of the length of its path."""
    part = series.until(until)
    path = part.last("path")
    return float(part.curves["distance"][0] - part.last("distance")) / path if path else math.nan


MEASURES = [
    Measure("arrival", "s after which the object is at the goal", _arrival),
    Measure("efficiency", "approach to the goal / path of the object", _efficiency),
    Measure("distance", "cm from the goal at {at:g} s", lambda series, at: series.at(at, "distance")),
]


def goal_of(scene: Scene) -> tuple[float, float, float]:
    """Return x, y and radius of the goal in cm. Raises SceneError for a scene without a goal or object."""
    for one in scene.obstacles:
        if one.name == "goal" and one.radius_cm and scene.objects.count:
            return one.x_cm, one.y_cm, one.radius_cm
    raise SceneError(f"{scene.name}: experiment transport needs an object and a round obstacle with the name goal")


def gaps(scene: Scene, places: Floats) -> Floats:
    """Return the distances in cm between goal and circle around the first object; 0 if they touch."""
    x, y, radius = goal_of(scene)
    away = np.hypot(places[:, 0] - x, places[:, 1] - y) - radius - scene.kind_of(0).radius_cm
    return np.asarray(np.maximum(away, 0.0))


def all_curves(samples: TrialSamples) -> Mapping[str, Floats]:
    """Return distance and path at every sample."""
    places = samples.objects[:, 0]
    steps = np.hypot(*np.diff(places, axis=0, prepend=places[:1]).T)
    return {"distance": gaps(samples.scene, places), "path": np.cumsum(np.where(steps < _JITTER_CM, 0.0, steps))}


def done(world: Supervisor) -> bool:
    """Whether the object is at the goal."""
    return bool(gaps(world.scene, world.objects[:1])[0] <= 0)
