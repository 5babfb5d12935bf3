"""Metrics of constructed arrangements, and statistics compared with known values."""

import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from arena.analysis.statistics import (
    _typical_interval,
    bootstrap_band,
    equivalence,
    pairs_needed,
    remark,
    sign_flip_test,
    signed_rank_p,
)
from arena.experiments import TrialSamples, experiment_of
from arena.metrics import (
    SMALL,
    MetricSeries,
    _largest_shares,
    clusters,
    compactness,
    largest_share,
    largest_shares,
    reach_of,
    time_to,
)
from arena.scene.loader import load_scene
from tests.watchdog import HANG

R = 5.0


def test_compactness_is_equation_2() -> None:
    """Equation 2 (epuck.md §8): four objects on a square of side 20 have the compactness 4 * 200 / (4 * 25) = 8."""
    square = np.array([(0, 0), (20, 0), (0, 20), (20, 20)], float)
    assert compactness(square, R) == pytest.approx(8.0)
    assert compactness(square + 100, R) == pytest.approx(8.0)
    assert compactness(np.zeros((0, 2)), R) == 0.0


def test_clusters_are_connected_by_less_than_four_radii() -> None:
    """A chain of objects is one cluster; a gap of exactly 4 radii separates clusters (epuck.md §8)."""
    places = np.array([(0, 0), (19, 0), (38, 0), (58, 0), (200, 0), (210, 0)], float)
    assert clusters(places, reach_of("4r", R)) == [0, 0, 0, 1, 2, 2]
    assert clusters(places, reach_of("12cm", R)) == [0, 1, 2, 3, 4, 4]
    assert largest_share(places, 20.0) == 0.5


def test_all_alone_is_one_of_n_and_nothing_is_nothing() -> None:
    """Single objects have the share 1/n; without objects the share is 0."""
    places = np.array([(100 * k, 0) for k in range(20)], float)
    assert largest_share(places, 20.0) == 0.05
    assert largest_share(np.zeros((0, 2)), 20.0) == 0.0


def test_time_to_a_share_is_the_first_sample_that_has_it() -> None:
    """The time to a share is that of the first sample with it (docs/experiment-appendix.md §1)."""
    times, shares = np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.1, 0.5, 0.4, 0.8])
    assert time_to(times, shares, 0.5) == 1.0
    assert time_to(times, shares, 0.8) == 3.0
    assert np.isnan(time_to(times, shares, 0.9))


MEETING = np.array([[(0, 0), (100, 0)], [(0, 0), (60, 0)], [(0, 0), (10, 0)]], float)


def series_of(places: np.ndarray, times: list[float]) -> MetricSeries:
    """Return the metrics of the clustering experiment for some positions."""
    robots = np.zeros((len(times), 0, 3))
    return experiment_of("clustering").series(
        TrialSamples(np.array(times), robots, places, load_scene("clustering"), {})
    )


def test_a_course_follows_objects_that_meet() -> None:
    """Share, compactness and mean over time follow objects that approach each other."""
    done = series_of(MEETING, [0.0, 1.0, 2.0])
    assert done.curves["share"].tolist() == [0.5, 0.5, 1.0]
    assert done.curves["compactness"].tolist() == [50.0, 18.0, 0.5]
    assert done.mean("compactness") == pytest.approx((34 + 9.25) / 2)
    assert done.at(1.5, "share") == 0.5


def test_equal_runs_are_equivalent_and_different_ones_are_not() -> None:
    """Runs are equivalent if the 90 % interval is within the margin (experiment-contract.md §5)."""
    rng = np.random.default_rng(0)
    base = rng.normal(0.9, 0.05, 10)
    near, far = base + rng.normal(0, 0.02, 10), base - 0.15
    assert equivalence(base, near, 0.1).equivalent
    result = equivalence(base, far + rng.normal(0, 0.02, 10), 0.1)
    assert not result.equivalent
    assert result.low > 0.1
    assert not equivalence(base, base + rng.normal(0, 0.4, 10), 0.1).equivalent  # few pairs, large variance
    with pytest.raises(ValueError, match="two or more pairs"):
        equivalence(base[:1], base[:1], 0.1)


def test_signed_ranks_are_exact_for_few_pairs() -> None:
    """Wilcoxon's test of five pairs that differ in the same direction gives p = 2 / 2^5."""
    ones = np.arange(5) + np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    assert signed_rank_p(ones, np.arange(5).astype(float)) == pytest.approx(2 / 32)
    assert signed_rank_p(ones, ones) == 1.0


def test_bootstrap_bands_hold_the_mean() -> None:
    """The bootstrap band contains the mean and is reproducible."""
    values = np.random.default_rng(1).normal(0, 1, (10, 3)) + np.array([0, 5, 9])
    low, high = bootstrap_band(values)
    assert (low < values.mean(axis=0)).all()
    assert (values.mean(axis=0) < high).all()
    assert (bootstrap_band(values)[0] == low).all()


def test_shares_of_all_samples_at_once_are_those_one_by_one() -> None:
    """Shares computed for all samples at once equal those of single samples, for chains, scattered objects, one
    object and none."""
    rng = np.random.default_rng(3)
    scattered = rng.uniform(0, 150, (200, 20, 2))
    chain = np.stack([np.column_stack([19.0 * rng.permutation(20), np.zeros(20)]) for _ in range(5)])
    for places in (scattered, chain, scattered[:, :1], scattered[:, :2]):
        assert largest_shares(places, 20.0).tolist() == [largest_share(one, 20.0) for one in places]
    assert largest_shares(chain, 20.0).tolist() == [1.0] * 5
    assert largest_shares(np.zeros((3, 0, 2)), 20.0).tolist() == [0.0] * 3


def test_the_pairs_needed_are_those_of_the_plan() -> None:
    """experiment-contract.md §5: a standard deviation of 0.25 needs about 107 trials per arm, 0.06 needs seven
    (independent arms)."""
    assert pairs_needed(0.25 * 2**0.5, 0.1) == pytest.approx(107, abs=1)
    assert pairs_needed(0.06 * 2**0.5, 0.1) == 7
    assert pairs_needed(0.0, 0.1) == 2


def test_a_course_can_be_cut() -> None:
    """`until` cuts a series, so that runs of unequal length can be compared."""
    done = series_of(MEETING, [0.0, 1.001, 2.0])
    assert done.until(1.0).times.tolist() == [0.0, 1.001]
    assert done.until(1.0).curves["share"].tolist() == [0.5, 0.5]
    assert done.until(9.0).mean("compactness") == done.mean("compactness")


@pytest.mark.parametrize("count", [SMALL, SMALL + 1, 90])
def test_few_and_many_objects_are_counted_alike(count: int) -> None:
    """Dense matrices and sparse graphs give equal shares; clusters are numbered by their first object."""
    rng = np.random.default_rng(count)
    places = rng.uniform(0, 25 * count**0.5, (30, count, 2))
    assert largest_shares(places, 20.0).tolist() == _largest_shares(places, 20.0).tolist()
    for one in places:
        labels = clusters(one, 20.0)
        assert list(dict.fromkeys(labels)) == list(range(max(labels) + 1))
        near = ((one[:, None] - one[None]) ** 2).sum(axis=2) < 400
        assert all(labels[i] == labels[j] for i, j in zip(*np.nonzero(near), strict=True))
        assert max(labels) + 1 == _parts(near)


def _parts(near: np.ndarray) -> int:
    """Return the connected components of a graph, computed by merging sets."""
    parts = [{i} for i in range(len(near))]
    for i, j in zip(*np.nonzero(near), strict=True):
        one, other = (next(part for part in parts if k in part) for k in (i, j))
        if one is not other:
            one |= other
            parts.remove(other)
    return len(parts)


def test_the_distance_of_the_rule_itself_is_not_near() -> None:
    """Objects at exactly the limit distance do not belong to the same cluster."""
    touching = np.array([(0.0, 0.0), (20.0, 0.0), (39.9, 0.0)])
    assert clusters(touching, 20.0) == [0, 1, 1]


METER = """
import resource, sys
import numpy as np
from arena.experiments import TrialSamples, experiment_of
from arena.scene.loader import load_scene
objects, samples = map(int, sys.argv[1:])
rng = np.random.default_rng(1)
places = rng.uniform(0, 1000, (1, objects, 2)) + rng.normal(0, 5, (samples, objects, 2)).cumsum(axis=0) / 30
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
series = experiment_of("clustering").series(
    TrialSamples(np.arange(samples) / 2, np.zeros((samples, 0, 3)), places, load_scene("clustering"), {}))
assert 0 < series.curves["share"].max() < 1
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the peak of memory has other units, or none, elsewhere")
def test_metrics_of_many_objects_need_little_memory() -> None:
    """Shares of 400 and of 100 objects over 15 minutes need less than 200 MB."""
    for objects in (100, 400):
        measured = subprocess.run([sys.executable, "-c", METER, str(objects), "1801"], capture_output=True, text=True,
                              check=True, timeout=HANG, cwd=Path(__file__).parents[2])  # fmt: skip
        assert int(measured.stdout) < 200  # MB


# -- statistics added to the registered ones ------------------------------------------------------------------------

TWO_SETS = [(-0.40, 0.05), (-0.30, -0.25, 0.05, 0.05, 0.05, 0.05)]
"""Two sets of ten differences whose printed values equal those of controller B in docs/experiment-appendix.md."""


def padded(differences: tuple[float, ...]) -> np.ndarray:
    return np.array([*differences, *[0.0] * (10 - len(differences))])


@pytest.mark.parametrize(("differences", "least"), list(zip(TWO_SETS, (0.5, 2 / 64), strict=True)))
def test_a_p_that_cannot_be_small_is_named(differences: tuple[float, ...], least: float) -> None:
    """With eight ties in ten pairs the smallest possible p of the test is 0.5, which the remark states."""
    x, y = padded(differences) + 0.9, np.full(10, 0.9)
    result = equivalence(x, y, 0.1)
    printed = f"{result.mean:+.3f} {result.low:+.3f} {result.high:+.3f} {signed_rank_p(x, y):.2f}"
    assert printed == "-0.035 -0.110 +0.040 1.00"
    found = sign_flip_test(x, y)
    assert (found.differ, found.least_p) == (len(differences), pytest.approx(least))
    assert ("cannot fall below 0.5" in remark(x, y, 1.0)) == (least == 0.5)


def test_the_sign_flip_test_is_that_of_all_signs() -> None:
    """The sign-flip test equals an enumeration of all 2^n sign assignments."""
    rng = np.random.default_rng(4)
    for count in (2, 3, 7, 10):
        d = rng.normal(0.3, 1, count)
        signs = np.array(list(itertools.product((1, -1), repeat=count)))
        means = (signs * d).mean(axis=1)
        by_hand = min(2 * min((means >= d.mean() - 1e-12).mean(), (means <= d.mean() + 1e-12).mean()), 1.0)
        assert sign_flip_test(d, np.zeros(count)).p == pytest.approx(by_hand)


def test_the_exact_interval_is_what_the_test_does_not_reject() -> None:
    """A shift just inside the exact interval has p above 10 %, one just outside p below 10 %; three pairs give an
    infinite interval."""
    d = np.random.default_rng(5).normal(1, 1, 9)
    found = sign_flip_test(d, np.zeros(9))
    for inside, outside in ((found.low + 1e-6, found.low - 1e-6), (found.high - 1e-6, found.high + 1e-6)):
        assert sign_flip_test(d - inside, np.zeros(9)).p > 0.1 - 1e-9
        assert sign_flip_test(d - outside, np.zeros(9)).p < 0.1 + 1e-9
    few = sign_flip_test(d[:3], np.zeros(3))
    assert (few.low, few.high) == (-np.inf, np.inf)


@pytest.mark.slow
def test_the_exact_interval_covers_what_it_says() -> None:
    """The exact 90 % interval contains the mean in 90 % of 400 random sets of ten pairs, and of 40 sets of twenty."""
    rng = np.random.default_rng(6)
    for count, draw in ((10, lambda n: rng.normal(0, 1, n)), (10, lambda n: rng.laplace(0, 1, n)),
                        (20, lambda n: rng.normal(0, 1, n))):  # fmt: skip
        tries = 400 if count == 10 else 40
        hits = 0
        for _ in range(tries):
            low, high = _typical_interval(draw(count), 0)
            hits += low <= 0 <= high
        assert hits / tries == pytest.approx(0.9, abs=0.05 if count == 10 else 0.12)


def test_ceilings_and_runs_without_spread_are_named() -> None:
    """If most values of both runs are at the maximum, or if all pairs are equal, the remark states it; otherwise it
    is empty."""
    x = np.array([1.0] * 9 + [0.6])
    assert (
        remark(x, x, 1.0)
        == "ceiling: both at the most possible in 9 of 10 pairs; all pairs equal: no spread to judge by"
    )
    rng = np.random.default_rng(7)
    assert remark(rng.normal(0, 1, 10), rng.normal(0, 1, 10), None) == ""
