"""Comparison of two runs, seed by seed, in the measures of their experiment (experiment-contract.md §5)."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from arena.analysis.statistics import Values, equivalence, remark, sign_flip_test, signed_rank_p
from arena.metrics import MetricSeries
from arena.trial.record import Trial

NEAR_S = 0.05
"""Tolerance, in seconds, between a sample and the requested time: quanta do not divide a second."""
APART_S = (2.0, 5.0, 10.0)
"""Times, in seconds, at which the positions of robots with equal seeds are compared."""
MARGIN_PART = 0.10
"""Default margin of a measure, as a share of the second run's mean (experiment-contract.md §5)."""


def series_by_seed(trials: list[Trial]) -> dict[int, tuple[Trial, MetricSeries]]:
    """Return each trial and its metrics by seed."""
    return {trial.about["seed"]: (trial, trial.series) for trial in trials}


def compare_runs(first: list[Trial], second: list[Trial], at: float) -> dict[str, Any]:
    """Compare all measures of the experiment, over the duration of the shortest trial.

    Raises ValueError for fewer than two common seeds, trials shorter than `at` seconds, or runs of two experiments."""
    experiment = first[0].experiment
    if second[0].experiment != experiment:
        raise ValueError(f"the runs are of two experiments, {experiment.name} and {second[0].experiment.name}")
    ones, others = series_by_seed(first), series_by_seed(second)
    seeds = sorted(set(ones) & set(others))
    if len(seeds) < 2:
        raise ValueError(f"the runs have {len(seeds)} seeds in common; a comparison needs two or more")
    end = min(one.times[-1] for _, one in [*ones.values(), *others.values()])
    if end < at - NEAR_S:
        raise ValueError(f"the shortest trial lasts {end:g} s, less than --at {at:g}")
    pairs = [tuple((trial, one.until(end)) for trial, one in (ones[seed], others[seed])) for seed in seeds]
    rows = []
    for measure in experiment.measures:
        x, y = (np.array([measure.of(pair[side][1], at) for pair in pairs]) for side in (0, 1))
        margin = measure.margin if measure.margin is not None else MARGIN_PART * float(abs(y.mean())) or 1e-9
        result, added = equivalence(x, y, margin), sign_flip_test(x, y)
        rows.append({"measure": measure.label.format(at=at), "first": _spread(x), "second": _spread(y),
                     **asdict(result), "equivalent": result.equivalent, "wilcoxon_p": signed_rank_p(x, y),
                     "pairs": [[float(one), float(other)] for one, other in zip(x, y, strict=True)],
                     "exact": asdict(added), "remark": remark(x, y, measure.best)})  # fmt: skip
    loads = [mean_load([trial for trial, _ in runs.values()]) for runs in (ones, others)]
    return {
        "seeds": seeds,
        "at": at,
        "measures": rows,
        "cpu_load": loads,
        "apart": _distances(pairs),
        "published": experiment.published,
    }


def _distances(pairs: list[Any]) -> list[dict[str, float]]:
    """Return the median and the maximum distance in cm between robots with equal numbers in trials with equal seeds."""
    found = []
    for seconds in APART_S:
        gaps: list[float] = []
        for (one, course_one), (other, _) in pairs:
            sample = int(np.searchsorted(course_one.times, seconds - NEAR_S))
            if sample < min(len(one.robots), len(other.robots)) and one.robots.shape == other.robots.shape:
                gaps += np.hypot(*(one.robots[sample] - other.robots[sample]).T).tolist()
        if gaps:
            found.append({"seconds": seconds, "median_cm": float(np.median(gaps)), "max_cm": max(gaps)})
    return found


def mean_load(trials: list[Trial]) -> float | None:
    """Return the CPU load averaged over robots, trials and time; None without robots or for scripted robots."""
    robots = range(trials[0].scene.robots.count)
    if not robots or trials[0].is_scripted:
        return None
    return float(np.mean([trial.columns[f"r{robot}_load"][1:].mean() for trial in trials for robot in robots]))


def _spread(values: Values) -> dict[str, float]:
    """Return mean and standard deviation (ddof = 1)."""
    return {"mean": float(values.mean()), "sd": float(values.std(ddof=1))}
