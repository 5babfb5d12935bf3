"""Metrics of object positions, each with its definition and source; lengths in cm, times in s.

    >>> import numpy as np
    >>> from arena.metrics import clusters, compactness, reach_of
    >>> places = np.array([(0.0, 0.0), (10.0, 0.0), (100.0, 0.0)])
    >>> clusters(places, reach_of("4r", radius_cm=5.0))
    [0, 0, 1]
    >>> round(compactness(places, radius_cm=5.0), 2)
    60.67

`arena.trial.record.Trial.series` is the MetricSeries of a recorded trial.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import coo_array

Places = NDArray[np.float64]
"""Positions, n x 2, in cm."""

CLUSTER_RULES: Final = {"4r": 4.0, "12cm": None}
"""Rules for adjacent objects. `4r`: centres nearer than 4 radii, so no other object fits between them (epuck.md §8).
`12cm`: centres nearer than 12 cm, for any radius (experiment-contract.md §3)."""


def reach_of(rule: str, radius_cm: float) -> float:
    """Return the centre distance in cm below which two objects are adjacent. Raises KeyError for an unknown rule."""
    factor = CLUSTER_RULES[rule]
    return 12.0 if factor is None else factor * radius_cm


def compactness(places: Places, radius_cm: float) -> float:
    """Return the compactness u, Eq. (2) of the reference (epuck.md §8): smaller is more compact.

    u = 1/(4 r^2) * sum of the squared distances of the objects to their centroid, without unit."""
    if not len(places):
        return 0.0
    return float(((places - places.mean(axis=0)) ** 2).sum() / (4 * radius_cm**2))


def compactnesses(places: NDArray[np.float64], radius_cm: float) -> NDArray[np.float64]:
    """Return `compactness` at every sample; `places` is samples x objects x 2."""
    return np.array([compactness(one, radius_cm) for one in places], dtype=float)


def clusters(places: Places, reach_cm: float) -> list[int]:
    """Return the cluster number of each object.

    A cluster is a connected component of the graph of adjacent objects; clusters are numbered in the order of their
    first objects. Memory grows with the number of adjacent pairs only."""
    if not len(places):
        return []
    from scipy.sparse.csgraph import connected_components  # imported here: SciPy takes most of the start of a command

    labels: list[int] = connected_components(_adjacent(places, reach_cm), directed=False)[1].tolist()
    return labels


def _adjacent(places: Places, reach_cm: float) -> coo_array:
    """Return the adjacency matrix of objects nearer to each other than `reach_cm`, as a sparse matrix."""
    from scipy.sparse import coo_array
    from scipy.spatial import cKDTree

    count = len(places)
    # The tree also returns pairs at exactly this distance, which are not adjacent.
    pairs = cKDTree(places).query_pairs(reach_cm, output_type="ndarray")
    one, other = places[pairs[:, 0]], places[pairs[:, 1]]
    near = pairs[((one - other) ** 2).sum(axis=1) < reach_cm**2]
    return coo_array((np.ones(len(near), dtype=np.int8), (near[:, 0], near[:, 1])), shape=(count, count))


def largest_share(places: Places, reach_cm: float) -> float:
    """Return the share of the objects in the largest cluster, 0..1; 0 without objects."""
    if not len(places):
        return 0.0
    return int(np.max(np.bincount(clusters(places, reach_cm)))) / len(places)


SMALL: Final = 48
"""Largest number of objects for which dense matrices are faster than sparse graphs."""
_CHUNK: Final = 1 << 20
"""Maximum number of elements of dense matrices in memory at a time, for any length of the trial."""


def largest_shares(places: NDArray[np.float64], reach_cm: float) -> NDArray[np.float64]:
    """Return `largest_share` at every sample; `places` is samples x objects x 2."""
    samples, count, _ = places.shape
    if not count:
        return np.zeros(samples)
    if count > SMALL:
        return np.array([largest_share(one, reach_cm) for one in places])
    chunk = max(_CHUNK // count**2, 1)
    parts = [_largest_shares(places[at : at + chunk], reach_cm) for at in range(0, samples, chunk)]
    return np.concatenate(parts) if parts else np.zeros(0)


def _largest_shares(places: NDArray[np.float64], reach_cm: float) -> NDArray[np.float64]:
    """Return `largest_shares` of few objects with dense matrices.

    The transitive closure of adjacency is the adjacency matrix, squared until paths of n - 1 steps are included."""
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
    """Return the first time in s at which the largest share is at least `share`; nan if there is none."""
    reached = np.flatnonzero(shares >= share - 1e-9)
    return float(times[reached[0]]) if len(reached) else float("nan")


HALF_QUANTUM_S: Final = 0.011
"""Tolerance of times: a sample is taken at the end of the quantum nearest to its time, and quanta last up to 20 ms."""


@dataclass(frozen=True)
class MetricSeries:
    """Metrics of one trial over time: `curves` by name, with one value per sample."""

    times: NDArray[np.float64]
    curves: Mapping[str, NDArray[np.float64]]

    def at(self, seconds: float, name: str) -> float:
        """Return the value of a metric at the last sample not after `seconds`, within half of the longest quantum."""
        return float(self.curves[name][max(int(np.searchsorted(self.times, seconds + HALF_QUANTUM_S)) - 1, 0)])

    def last(self, name: str) -> float:
        """Return the value of a metric at the last sample."""
        return float(self.curves[name][-1])

    def first(self, name: str, level: float) -> float:
        """Return the first time in s at which a metric is at least `level`; nan if there is none."""
        return time_to(self.times, self.curves[name], level)

    def until(self, seconds: float) -> MetricSeries:
        """Return the samples up to `seconds`."""
        count = int(np.searchsorted(self.times, seconds + HALF_QUANTUM_S))
        return MetricSeries(self.times[:count], {name: values[:count] for name, values in self.curves.items()})

    def mean(self, name: str) -> float:
        """Return the mean of a metric over time: the area under its curve divided by the duration."""
        values = self.curves[name]
        if len(self.times) < 2:
            return float(values[0])
        return float(np.trapezoid(values, self.times) / (self.times[-1] - self.times[0]))
