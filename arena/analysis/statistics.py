"""Statistics of the comparison of two runs (experiment-contract.md §5): pre-registered tests and further ones.

Pre-registered: equivalence by two one-sided t tests, Wilcoxon's signed ranks, bootstrap bands. A t interval is unsound
for few pairs with many ties; for this case there are further tests: the exact sign-flip test with its interval and its
smallest possible p. A remark says where a comparison cannot find a difference: both runs at the measure's ceiling, all
pairs equal, or too few unequal pairs. Differences are taken seed by seed; random draws are seeded.
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
    """Equivalence test (TOST at 5 %): mean difference of pairs and its 90 % confidence interval, against +-margin."""

    count: int
    mean: float
    deviation: float
    low: float
    high: float
    margin: float
    p: float
    """Larger p value of the two one-sided tests."""

    @property
    def equivalent(self) -> bool:
        """Whether both one-sided tests reject at 5 %."""
        return self.p < 0.05


def equivalence(one: Values, other: Values, margin: float) -> Equivalence:
    """Run two one-sided paired t tests. Raises ValueError for fewer than two pairs or unequal lengths."""
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
    """Return the two-sided p of Wilcoxon's signed-rank test; 1.0 if all differences are zero.

    The test is exact for at most 25 pairs without ties. Otherwise it uses the normal approximation with a correction
    for ties. Zero differences are dropped."""
    difference = (one - other)[one != other]
    count = len(difference)
    if not count:
        return 1.0
    is_exact = count <= 25 and len(set(np.abs(difference).tolist())) == count
    return float(wilcoxon(difference, method="exact" if is_exact else "approx", correction=True).pvalue)


EXACT_PAIRS: Final = 16
"""Maximum number of unequal pairs for which all sign flips (65,536) are tried; more pairs use a seeded sample."""
DRAWS: Final = 99_999


@dataclass(frozen=True)
class SignFlipTest:
    """Sign-flip test of pairs: under the null hypothesis each difference has either sign with equal probability.

    `differ` is the number of unequal pairs and `p` the two-sided p value. `least_p` is the smallest possible p for so
    many pairs, 2 / 2^differ; if it is not small, a large p is no evidence.

    `low`..`high` is the 90 % interval of the mean difference by Hartigan's typical values (JASA 64, 1969): of the means
    of all subsets of the pairs, 5 % are cut off on each side. It is unbounded for too few pairs. The method assumes
    that the differences are symmetric about their centre.
    """

    differ: int
    p: float
    least_p: float
    low: float
    high: float


def sign_flip_test(one: Values, other: Values, seed: int = 0) -> SignFlipTest:
    """Run the sign-flip test. Raises ValueError for fewer than two pairs or unequal lengths."""
    if len(one) != len(other) or len(one) < 2:
        raise ValueError(f"a test needs two or more pairs, not {len(one)} and {len(other)} values")
    difference = np.round(one - other, 12)  # differences of equal size must compare equal in spite of rounding
    moved = difference[difference != 0]
    least = min(2.0 ** (1 - len(moved)), 1.0)
    if not len(moved):
        p = 1.0
    elif len(moved) == 1:
        p = 1.0  # with one pair, both signs are equally extreme
    else:
        draws = np.inf if len(moved) <= EXACT_PAIRS else DRAWS
        p = float(permutation_test((moved,), np.mean, permutation_type="samples", vectorized=True, n_resamples=draws,
                                   batch=4096, random_state=seed).pvalue)  # fmt: skip
    low, high = _typical_interval(difference, seed)
    return SignFlipTest(len(moved), p, least, low, high)


def _typical_interval(difference: Values, seed: int) -> tuple[float, float]:
    """Return the 90 % interval by the means of all subsets of the pairs, or of a seeded sample of subsets."""
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
    """Return a remark on the limits of a comparison, or an empty string. `best` is the largest possible value."""
    found = sign_flip_test(one, other)
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
    """Return the number of pairs for which the equivalence test of equal means has the given power, at least 2.

    Normal approximation: ((z(95 %) + z((1 + power) / 2)) * deviation / margin)^2."""
    normal = NormalDist()
    z = normal.inv_cdf(0.95) + normal.inv_cdf((1 + power) / 2)
    return max(math.ceil((z * deviation / margin) ** 2), 2)


def bootstrap_band(courses: Values, *, share: float = 0.95, draws: int = 1000, seed: int = 0) -> tuple[Values, Values]:
    """Return the bootstrap band of the mean over trials (rows) at each time (columns)."""
    rng = np.random.default_rng(seed)
    count = len(courses)
    picks = rng.integers(count, size=(draws, count))
    times = np.stack([np.bincount(one, minlength=count) for one in picks])
    means = times @ courses / count  # counts of draws need less memory than copies of the trials
    low, high = np.quantile(means, [(1 - share) / 2, (1 + share) / 2], axis=0)
    return low, high
