"""What can be measured about objects, each with its definition and source. Lengths cm, times s."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

Places = NDArray[np.float64]
"""n x 2."""

CLUSTER_RULES: Final = {"4r": 4.0, "12cm": None}
"""Objects belong together if their centres are nearer than 4 radii, so that no other fits between them (epuck.md §8),
or nearer than 12 cm, whatever the radius (experiment-contract.md §3)."""


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


def compactnesses(places: NDArray[np.float64], radius_cm: float) -> NDArray[np.float64]:
    """`compactness` at every sample: `places` is samples x objects x 2."""
    return np.array([compactness(one, radius_cm) for one in places], dtype=float)


def clusters(places: Places, reach_cm: float) -> list[int]:
    """For each object the number of its cluster: connected parts of the graph of adjacent objects, numbered in the
    order of their first object. Memory grows with the number of neighbours, not of pairs."""
    if not len(places):
        return []
    labels: list[int] = connected_components(_adjacent(places, reach_cm), directed=False)[1].tolist()
    return labels


def _adjacent(places: Places, reach_cm: float) -> coo_array:
    """The pairs of objects nearer to each other than `reach_cm`, as a sparse matrix."""
    count = len(places)
    pairs = cKDTree(places).query_pairs(
        reach_cm, output_type="ndarray"
    )  # includes the distance itself, which we do not
    one, other = places[pairs[:, 0]], places[pairs[:, 1]]
    near = pairs[((one - other) ** 2).sum(axis=1) < reach_cm**2]
    return coo_array((np.ones(len(near), dtype=np.int8), (near[:, 0], near[:, 1])), shape=(count, count))


def largest_share(places: Places, reach_cm: float) -> float:
    """Share of the objects that are in the largest cluster, 0..1; 0 without objects."""
    if not len(places):
        return 0.0
    return int(np.max(np.bincount(clusters(places, reach_cm)))) / len(places)


SMALL: Final = 48
"""Objects up to which matrices of all pairs are quicker than sparse graphs."""
_CHUNK: Final = 1 << 20
"""Numbers in such matrices at a time: memory stays the same however long a trial is."""


def largest_shares(places: NDArray[np.float64], reach_cm: float) -> NDArray[np.float64]:
    """`largest_share` at every sample: `places` is samples x objects x 2."""
    samples, count, _ = places.shape
    if not count:
        return np.zeros(samples)
    if count > SMALL:
        return np.array([largest_share(one, reach_cm) for one in places])
    chunk = max(_CHUNK // count**2, 1)
    parts = [_largest_shares(places[at : at + chunk], reach_cm) for at in range(0, samples, chunk)]
    return np.concatenate(parts) if parts else np.zeros(0)


def _largest_shares(places: NDArray[np.float64], reach_cm: float) -> NDArray[np.float64]:
    """For few objects. Who reaches whom over any number of others is the adjacency matrix squared until every path of
    n - 1 steps is in it."""
    count = places.shape[1]
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
class MetricSeries:
    """Metrics of one trial over time: `curves` by name, one value per sample."""

    times: NDArray[np.float64]
    curves: Mapping[str, NDArray[np.float64]]

    def at(self, seconds: float, name: str) -> float:
        """A value at the last sample not after `seconds`, give or take half of the longest quantum."""
        return float(self.curves[name][max(int(np.searchsorted(self.times, seconds + HALF_QUANTUM_S)) - 1, 0)])

    def last(self, name: str) -> float:
        """A value at the end."""
        return float(self.curves[name][-1])

    def first(self, name: str, level: float) -> float:
        """First time at which a curve is at least at a level; nan if never."""
        return time_to(self.times, self.curves[name], level)

    def until(self, seconds: float) -> MetricSeries:
        """The same up to `seconds`."""
        count = int(np.searchsorted(self.times, seconds + HALF_QUANTUM_S))
        return MetricSeries(self.times[:count], {name: values[:count] for name, values in self.curves.items()})

    def mean(self, name: str) -> float:
        """Mean over the trial's time: the area under a curve divided by its length."""
        values = self.curves[name]
        if len(self.times) < 2:
            return float(values[0])
        return float(np.trapezoid(values, self.times) / (self.times[-1] - self.times[0]))
