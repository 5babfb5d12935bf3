"""What is measured about the objects, each with its definition and source. Lengths cm, times s."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Places = NDArray[np.float64]
"""n x 2."""

CLUSTER_RULES: Final = {"4r": 4.0, "12cm": None}
"""Objects belong together if their centres are nearer than 4 radii, so that no other fits between them (epuck.md §8),
or nearer than 12 cm, whatever the radius (experiment.md §3)."""


def reach_of(rule: str, radius_cm: float) -> float:
    """Centre distance below which two objects are adjacent. Raises KeyError for an unknown rule."""
    factor = CLUSTER_RULES[rule]
    return 12.0 if factor is None else factor * radius_cm


def compactness(places: Places, radius_cm: float) -> float:
    """u = 1/(4 r^2) * sum of squared distances of the objects to their centroid, Eq. (2) (epuck.md §8). Smaller is
    more compact; no unit."""
    if not len(places):
        return 0.0
    return float(((places - places.mean(axis=0)) ** 2).sum() / (4 * radius_cm**2))


def clusters(places: Places, reach_cm: float) -> list[int]:
    """For each object the number of its cluster: connected parts of the graph of adjacent objects, numbered in the
    order of their first object."""
    count = len(places)
    near = ((places[:, None, :] - places[None, :, :]) ** 2).sum(axis=2) < reach_cm**2
    label = [-1] * count
    found = 0
    for first in range(count):
        if label[first] >= 0:
            continue
        label[first] = found
        open_ends = [first]
        while open_ends:
            for other in np.flatnonzero(near[open_ends.pop()]).tolist():
                if label[other] < 0:
                    label[other] = found
                    open_ends.append(other)
        found += 1
    return label


def largest_share(places: Places, reach_cm: float) -> float:
    """Share of the objects that are in the largest cluster, 0..1; 0 without objects."""
    if not len(places):
        return 0.0
    labels = clusters(places, reach_cm)
    return max(labels.count(one) for one in set(labels)) / len(labels)


def largest_shares(places: NDArray[np.float64], reach_cm: float) -> NDArray[np.float64]:
    """`largest_share` at every sample at once: `places` is samples x objects x 2. Who reaches whom over any number of
    others is the adjacency matrix squared until every path of n - 1 steps is in it."""
    samples, count, _ = places.shape
    if not count:
        return np.zeros(samples)
    away = places[:, :, None, :] - places[:, None, :, :]
    reached = ((away**2).sum(axis=3) < reach_cm**2).astype(np.float32)
    steps = 1
    while steps < count - 1:
        reached = (reached @ reached > 0).astype(np.float32)
        steps *= 2
    shares: NDArray[np.float64] = reached.sum(axis=2).max(axis=1).astype(np.float64) / count
    return shares


def time_to(times: NDArray[np.float64], shares: NDArray[np.float64], share: float) -> float:
    """First time at which the largest share is at least `share`; nan if never."""
    reached = np.flatnonzero(shares >= share - 1e-9)
    return float(times[reached[0]]) if len(reached) else float("nan")


HALF_QUANTUM_S: Final = 0.011
"""Samples are taken at the end of the quantum nearest to the time asked; quanta last up to 20 ms (scene.py)."""


@dataclass(frozen=True)
class Course:
    """The metrics of one trial over time."""

    times: NDArray[np.float64]
    share: NDArray[np.float64]
    share_12cm: NDArray[np.float64]
    compactness: NDArray[np.float64]

    def at(self, seconds: float, values: NDArray[np.float64]) -> float:
        """A value at the last sample not after `seconds`, give or take half of the longest quantum."""
        return float(values[max(int(np.searchsorted(self.times, seconds + HALF_QUANTUM_S)) - 1, 0)])

    def until(self, seconds: float) -> Course:
        """The same up to `seconds`."""
        count = int(np.searchsorted(self.times, seconds + HALF_QUANTUM_S))
        return Course(self.times[:count], self.share[:count], self.share_12cm[:count], self.compactness[:count])

    @property
    def area(self) -> float:
        """Mean of the compactness over the trial's time: the area under u(t) divided by its length."""
        if len(self.times) < 2:
            return float(self.compactness[0])
        return float(np.trapezoid(self.compactness, self.times) / (self.times[-1] - self.times[0]))


def course(times: NDArray[np.float64], places: NDArray[np.float64], radius_cm: float) -> Course:
    """Metrics of a trial: `places` is samples x objects x 2."""
    wide, narrow = reach_of("4r", radius_cm), reach_of("12cm", radius_cm)
    return Course(
        times,
        largest_shares(places, wide),
        largest_shares(places, narrow),
        np.array([compactness(one, radius_cm) for one in places]),
    )
