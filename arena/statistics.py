"""Comparing two runs (experiment.md §5): equivalence by two one-sided tests, Wilcoxon's signed ranks, bootstrap bands.

Differences are taken seed by seed. Everything is computed here from its definition; nothing is random but the
bootstrap, which is seeded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Equivalence:
    """Mean difference of pairs, its 90 % confidence interval, and whether that lies within +-margin (TOST at 5 %)."""

    count: int
    mean: float
    deviation: float
    low: float
    high: float
    margin: float
    p: float
    """The larger p value of the two one-sided tests."""

    @property
    def equivalent(self) -> bool:
        """Both one-sided tests reject at 5 %."""
        return self.p < 0.05


def equivalence(one: Values, other: Values, margin: float) -> Equivalence:
    """Two one-sided paired t tests. Raises ValueError for fewer than two pairs or unequal lengths."""
    if len(one) != len(other) or len(one) < 2:
        raise ValueError(f"equivalence needs two or more pairs, not {len(one)} and {len(other)} values")
    difference = one - other
    count = len(difference)
    mean, deviation = float(difference.mean()), float(difference.std(ddof=1))
    error = deviation / math.sqrt(count)
    if error == 0:
        p = 0.0 if abs(mean) < margin else 1.0
        return Equivalence(count, mean, deviation, mean, mean, margin, p)
    p = max(1 - student_cdf((mean + margin) / error, count - 1), student_cdf((mean - margin) / error, count - 1))
    half = student_quantile(0.95, count - 1) * error
    return Equivalence(count, mean, deviation, mean - half, mean + half, margin, p)


def student_cdf(t: float, freedom: int) -> float:
    """Distribution function of Student's t, by Simpson's rule over its density in the angle atan(t / sqrt(n))."""
    end = math.atan2(t, math.sqrt(freedom))
    steps = 2000
    angles = np.linspace(0.0, end, steps + 1)
    density = np.cos(angles) ** (freedom - 1)
    weights = np.ones(steps + 1)
    weights[1:-1:2], weights[2:-1:2] = 4, 2
    integral = float((weights * density).sum()) * end / steps / 3
    scale = math.exp(math.lgamma((freedom + 1) / 2) - math.lgamma(freedom / 2)) / math.sqrt(math.pi)
    return 0.5 + scale * integral


def student_quantile(p: float, freedom: int) -> float:
    """Inverse of `student_cdf` by bisection."""
    low, high = -1e3, 1e3
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if student_cdf(middle, freedom) < p else (low, middle)
    return (low + high) / 2


def signed_rank_p(one: Values, other: Values) -> float:
    """Two-sided p of Wilcoxon's signed-rank test: exact up to 25 pairs without ties, else by the normal distribution
    with ties corrected. Zero differences are dropped; 1.0 if nothing is left."""
    difference = one - other
    difference = difference[difference != 0]
    count = len(difference)
    if not count:
        return 1.0
    sizes = np.abs(difference)
    ranks = np.array([(sizes < size).sum() + ((sizes == size).sum() + 1) / 2 for size in sizes])
    positive = float(ranks[difference > 0].sum())
    total = count * (count + 1) / 2
    if count <= 25 and len(set(sizes.tolist())) == count:
        ways = np.zeros(int(total) + 1)
        ways[0] = 1
        for rank in range(1, count + 1):
            ways[rank:] = ways[rank:] + ways[:-rank].copy()
        smaller = ways[: int(min(positive, total - positive)) + 1].sum() / 2.0**count
        return float(min(1.0, 2 * smaller))
    variance = float((ranks**2).sum()) / 4
    z = max(abs(positive - total / 2) - 0.5, 0.0) / math.sqrt(variance)
    return math.erfc(z / math.sqrt(2))


def pairs_needed(deviation: float, margin: float, power: float = 0.8) -> int:
    """Pairs with which two equal means are found equivalent with probability `power`, by the normal distribution:
    ((z(95 %) + z((1 + power) / 2)) * deviation / margin)^2, at least 2."""
    normal = NormalDist()
    z = normal.inv_cdf(0.95) + normal.inv_cdf((1 + power) / 2)
    return max(math.ceil((z * deviation / margin) ** 2), 2)


def bootstrap_band(courses: Values, *, share: float = 0.95, draws: int = 1000, seed: int = 0) -> tuple[Values, Values]:
    """Band of the mean over trials (rows) at each time (columns) by drawing trials with replacement."""
    rng = np.random.default_rng(seed)
    count = len(courses)
    picks = rng.integers(count, size=(draws, count))
    times = np.stack([np.bincount(one, minlength=count) for one in picks])
    means = times @ courses / count  # how often each trial was drawn, instead of copies of all trials for every draw
    low, high = np.quantile(means, [(1 - share) / 2, (1 + share) / 2], axis=0)
    return low, high
