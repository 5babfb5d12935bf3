"""Comparing two runs (experiment.md §5): what was registered, and what was added to it later.

Registered: equivalence by two one-sided t tests, Wilcoxon's signed ranks, bootstrap bands. Added, because with few
pairs that mostly tie a t interval is unsound: the exact test of sign flips and the interval that belongs to it, how
small its p can become at all, and whether the measure had room to differ. Differences are taken seed by seed; what is
drawn is seeded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import permutation_test, wilcoxon
from scipy.stats import t as student_t

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
    student = student_t(count - 1)
    p = float(max(student.sf((mean + margin) / error), student.cdf((mean - margin) / error)))
    half = float(student.ppf(0.95)) * error
    return Equivalence(count, mean, deviation, mean - half, mean + half, margin, p)


def signed_rank_p(one: Values, other: Values) -> float:
    """Two-sided p of Wilcoxon's signed-rank test: exact up to 25 pairs without ties, else by the normal distribution
    with ties corrected. Zero differences are dropped; 1.0 if nothing is left."""
    difference = (one - other)[one != other]
    count = len(difference)
    if not count:
        return 1.0
    is_exact = count <= 25 and len(set(np.abs(difference).tolist())) == count
    return float(wilcoxon(difference, method="exact" if is_exact else "approx", correction=True).pvalue)


EXACT_PAIRS: Final = 16
"""Up to so many pairs that differ all sign flips are tried, 65,536; of more a seeded sample."""
DRAWS: Final = 99_999


@dataclass(frozen=True)
class Exact:
    """The sign-flip test of pairs: under "no difference" every difference could as well have the other sign.

    `differ` pairs are not equal; `p` is two-sided; `least_p` is the smallest that so many pairs could give, 2 over
    2^differ: where it is not small, a large p says nothing.
    `low`..`high` is the interval of the mean difference that the test
    does not reject at 10 %, by Hartigan's typical values (JASA 64, 1969): the means of all subsets of the pairs, of
    which 5 % are cut off on each side; unlimited where there are too few. It assumes differences symmetric about it.
    """

    differ: int
    p: float
    least_p: float
    low: float
    high: float


def exact(one: Values, other: Values, seed: int = 0) -> Exact:
    """The sign-flip test. Raises ValueError for fewer than two pairs or unequal lengths."""
    if len(one) != len(other) or len(one) < 2:
        raise ValueError(f"a test needs two or more pairs, not {len(one)} and {len(other)} values")
    difference = np.round(one - other, 12)  # equal sizes are equal, whatever the last bit says
    moved = difference[difference != 0]
    least = min(2.0 ** (1 - len(moved)), 1.0)
    if not len(moved):
        p = 1.0
    elif len(moved) == 1:
        p = 1.0  # a flip of the only pair is as extreme
    else:
        draws = np.inf if len(moved) <= EXACT_PAIRS else DRAWS
        p = float(permutation_test((moved,), np.mean, permutation_type="samples", vectorized=True, n_resamples=draws,
                                   batch=4096, random_state=seed).pvalue)  # fmt: skip
    low, high = _typical(difference, seed)
    return Exact(len(moved), p, least, low, high)


def _typical(difference: Values, seed: int) -> tuple[float, float]:
    """90 % interval by the means of all (or many drawn) subsets of the pairs."""
    count = len(difference)
    if count <= EXACT_PAIRS:
        subsets = (np.arange(1, 1 << count)[:, None] >> np.arange(count)) & 1
    else:
        subsets = np.random.default_rng(seed).integers(0, 2, (DRAWS, count))
        subsets = subsets[subsets.any(axis=1)]
    means = np.sort(subsets @ difference / subsets.sum(axis=1))
    cut = int(0.05 * (len(means) + 1))
    if not cut:
        return -math.inf, math.inf
    return float(means[cut - 1]), float(means[-cut])


def remark(one: Values, other: Values, best: float | None, digits: int = 3) -> str:
    """What has to be known to read a comparison; empty if nothing has. `best` is the value nothing can exceed."""
    found = exact(one, other)
    full = int(((one == best) & (other == best)).sum()) if best is not None else 0
    words = []
    if full > len(one) / 2:
        words.append(f"ceiling: both at the most possible in {full} of {len(one)} pairs")
    if not found.differ:
        words.append("all pairs equal: no spread to judge by")
    elif found.least_p > 0.05:
        words.append(f"{found.differ} of {len(one)} pairs differ: p cannot fall below {found.least_p:.2g}")
    return "; ".join(words)


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
