"""Metrics on arrangements made by hand, and the statistics against known values."""

import numpy as np
import pytest

from arena.metrics import clusters, compactness, course, largest_share, largest_shares, reach_of, time_to
from arena.statistics import bootstrap_band, equivalence, pairs_needed, signed_rank_p, student_cdf, student_quantile

R = 5.0


def test_compactness_is_equation_2() -> None:
    """Four objects on a square of side 20: 4 * 200 / (4 * 25) = 8 (epuck.md §8)."""
    square = np.array([(0, 0), (20, 0), (0, 20), (20, 20)], float)
    assert compactness(square, R) == pytest.approx(8.0)
    assert compactness(square + 100, R) == pytest.approx(8.0)
    assert compactness(np.zeros((0, 2)), R) == 0.0


def test_clusters_are_connected_by_less_than_four_radii() -> None:
    """epuck.md §8: a chain holds together, a gap of exactly 4 r does not."""
    places = np.array([(0, 0), (19, 0), (38, 0), (58, 0), (200, 0), (210, 0)], float)
    assert clusters(places, reach_of("4r", R)) == [0, 0, 0, 1, 2, 2]
    assert clusters(places, reach_of("12cm", R)) == [0, 1, 2, 3, 4, 4]
    assert largest_share(places, 20.0) == 0.5


def test_all_alone_is_one_of_n_and_nothing_is_nothing() -> None:
    """Limits of the share."""
    places = np.array([(100 * k, 0) for k in range(20)], float)
    assert largest_share(places, 20.0) == 0.05
    assert largest_share(np.zeros((0, 2)), 20.0) == 0.0


def test_time_to_a_share_is_the_first_sample_that_has_it() -> None:
    """docs/experiment.md §1."""
    times, shares = np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.1, 0.5, 0.4, 0.8])
    assert time_to(times, shares, 0.5) == 1.0
    assert time_to(times, shares, 0.8) == 3.0
    assert np.isnan(time_to(times, shares, 0.9))


def test_a_course_follows_objects_that_meet() -> None:
    """Share, compactness, and the area as a mean over time."""
    places = np.array([[(0, 0), (100, 0)], [(0, 0), (60, 0)], [(0, 0), (10, 0)]], float)
    done = course(np.array([0.0, 1.0, 2.0]), places, R)
    assert done.share.tolist() == [0.5, 0.5, 1.0]
    assert done.compactness.tolist() == [50.0, 18.0, 0.5]
    assert done.area == pytest.approx((34 + 9.25) / 2)
    assert done.at(1.5, done.share) == 0.5


@pytest.mark.parametrize(("freedom", "quantile"), [(1, 6.3138), (9, 1.8331), (30, 1.6973), (106, 1.6594)])
def test_students_distribution_agrees_with_its_tables(freedom: int, quantile: float) -> None:
    """95 % quantiles of Student's t."""
    assert student_quantile(0.95, freedom) == pytest.approx(quantile, abs=2e-4)
    assert student_cdf(quantile, freedom) == pytest.approx(0.95, abs=2e-5)
    assert student_cdf(-quantile, freedom) == pytest.approx(0.05, abs=2e-5)


def test_equal_runs_are_equivalent_and_different_ones_are_not() -> None:
    """experiment.md §5: 90 % interval within the margin."""
    rng = np.random.default_rng(0)
    base = rng.normal(0.9, 0.05, 10)
    near, far = base + rng.normal(0, 0.02, 10), base - 0.15
    assert equivalence(base, near, 0.1).equivalent
    result = equivalence(base, far + rng.normal(0, 0.02, 10), 0.1)
    assert not result.equivalent
    assert result.low > 0.1
    assert not equivalence(base, base + rng.normal(0, 0.4, 10), 0.1).equivalent  # few and scattered: not shown
    with pytest.raises(ValueError, match="two or more pairs"):
        equivalence(base[:1], base[:1], 0.1)


def test_signed_ranks_are_exact_for_few_pairs() -> None:
    """Five pairs that all differ one way: p = 2 / 2^5."""
    ones = np.arange(5) + np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    assert signed_rank_p(ones, np.arange(5).astype(float)) == pytest.approx(2 / 32)
    assert signed_rank_p(ones, ones) == 1.0


def test_bootstrap_bands_hold_the_mean() -> None:
    """And are the same every time."""
    values = np.random.default_rng(1).normal(0, 1, (10, 3)) + np.array([0, 5, 9])
    low, high = bootstrap_band(values)
    assert (low < values.mean(axis=0)).all()
    assert (values.mean(axis=0) < high).all()
    assert (bootstrap_band(values)[0] == low).all()


def test_shares_of_all_samples_at_once_are_those_one_by_one() -> None:
    """Chains of up to all objects, scattered ones, one, none."""
    rng = np.random.default_rng(3)
    scattered = rng.uniform(0, 150, (200, 20, 2))
    chain = np.stack([np.column_stack([19.0 * rng.permutation(20), np.zeros(20)]) for _ in range(5)])
    for places in (scattered, chain, scattered[:, :1], scattered[:, :2]):
        assert largest_shares(places, 20.0).tolist() == [largest_share(one, 20.0) for one in places]
    assert largest_shares(chain, 20.0).tolist() == [1.0] * 5
    assert largest_shares(np.zeros((3, 0, 2)), 20.0).tolist() == [0.0] * 3


def test_the_pairs_needed_are_those_of_the_plan() -> None:
    """experiment.md §5: at a standard deviation of 0.25 about 107 trials per arm, at 0.06 seven (independent arms)."""
    assert pairs_needed(0.25 * 2**0.5, 0.1) == pytest.approx(107, abs=1)
    assert pairs_needed(0.06 * 2**0.5, 0.1) == 7
    assert pairs_needed(0.0, 0.1) == 2


def test_a_course_can_be_cut() -> None:
    """Runs of unequal length are compared over the time they have in common."""
    places = np.array([[(0, 0), (100, 0)], [(0, 0), (60, 0)], [(0, 0), (10, 0)]], float)
    done = course(np.array([0.0, 1.001, 2.0]), places, R)
    assert done.until(1.0).times.tolist() == [0.0, 1.001]
    assert done.until(1.0).share.tolist() == [0.5, 0.5]
    assert done.until(9.0).area == done.area
