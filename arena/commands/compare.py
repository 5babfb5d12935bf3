"""`arena compare X Y`: two runs, seed by seed (experiment.md §5)."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from arena.metrics import Course, time_to
from arena.record import Trial, trials_in
from arena.statistics import Values, equivalence, signed_rank_p

PUBLISHED = "86.5 % after 600 s: ten trials with real robots, reported for ref. [10], not for either run here"
NEAR_S = 0.05
"""A sample this near to the time asked for is at that time: quanta do not divide a second."""
APART_S = (2.0, 5.0, 10.0)
"""When robots of the same seed are compared."""
MARGIN_SHARE = 0.10
"""10 points (experiment.md §5); for the other measures 10 % of the second run's mean."""


def parser() -> argparse.ArgumentParser:
    """Options of the command."""
    made = argparse.ArgumentParser(
        description="compare two runs by equivalence tests",
        epilog="example: arena compare results/clustering-openswarm-A results/clustering-bare-A",
    )
    made.add_argument("first", type=Path, metavar="X", help="folder of a run")
    made.add_argument("second", type=Path, metavar="Y")
    made.add_argument("--at", type=float, default=600.0, metavar="S", help="time of the share (default 600 s)")
    made.add_argument("--json", action="store_true")
    return made


def courses(trials: list[Trial]) -> dict[int, tuple[Trial, Course]]:
    """Metrics of each trial by seed."""
    return {int(trial.about["seed"]): (trial, trial.course) for trial in trials}


def compared(first: list[Trial], second: list[Trial], at: float) -> dict[str, Any]:
    """All measures, over the time of the shortest trial. Raises ValueError for fewer than two seeds in common or trials
    shorter than `at`."""
    ones, others = courses(first), courses(second)
    seeds = sorted(set(ones) & set(others))
    if len(seeds) < 2:
        raise ValueError(f"the runs have {len(seeds)} seeds in common; a comparison needs two or more")
    end = min(one.times[-1] for _, one in [*ones.values(), *others.values()])
    if end < at - NEAR_S:
        raise ValueError(f"the shortest trial lasts {end:g} s, less than --at {at:g}")
    pairs = [tuple((trial, one.until(end)) for trial, one in (ones[seed], others[seed])) for seed in seeds]

    def both(value: Any) -> tuple[Values, Values]:
        return (np.array([value(*one) for one, _ in pairs]), np.array([value(*other) for _, other in pairs]))

    def until_80(_trial: Trial, one: Course) -> float:
        reached = time_to(one.times, one.share, 0.8)
        return float(one.times[-1]) if np.isnan(reached) else reached

    measures = {
        f"share at {at:g} s": (both(lambda _t, one: one.at(at, one.share)), MARGIN_SHARE),
        f"share at {at:g} s, 12 cm rule": (both(lambda _t, one: one.at(at, one.share_12cm)), MARGIN_SHARE),
        "mean compactness": (both(lambda _t, one: one.area), None),
        "time to 80 % (s, the end if never)": (both(until_80), None),
    }
    rows = []
    for name, ((x, y), margin) in measures.items():
        result = equivalence(x, y, margin if margin is not None else 0.1 * float(abs(y.mean())) or 1e-9)
        rows.append({"measure": name, "first": _spread(x), "second": _spread(y), **asdict(result),
                     "equivalent": result.equivalent, "wilcoxon_p": signed_rank_p(x, y)})  # fmt: skip
    loads = [mean_load([trial for trial, _ in runs.values()]) for runs in (ones, others)]
    return {
        "seeds": seeds,
        "at": at,
        "measures": rows,
        "cpu_load": loads,
        "apart": _apart(pairs),
        "published": PUBLISHED,
    }


def _apart(pairs: list[Any]) -> list[dict[str, float]]:
    """Distance in cm between a robot and its twin in the trial of the same seed, over robots and seeds."""
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


def mean_load(trials: list[Trial]) -> float:
    """CPU load averaged over robots, trials and time; 0 without robots."""
    robots = range(trials[0].about["scene"]["robots"]["count"])
    if not robots:
        return 0.0
    return float(np.mean([trial.columns[f"r{robot}_load"][1:].mean() for trial in trials for robot in robots]))


def _spread(values: Values) -> dict[str, float]:
    return {"mean": float(values.mean()), "sd": float(values.std(ddof=1))}


def run(options: argparse.Namespace) -> int:
    """Print the table. Raises RecordError, ValueError."""
    result = compared(trials_in(options.first), trials_in(options.second), options.at)
    if options.json:
        print(json.dumps(result))
        return 0
    print(f"X = {options.first}\nY = {options.second}\n{len(result['seeds'])} seeds in common")
    for row in result["measures"]:
        x, y = row["first"], row["second"]
        verdict = "equivalent" if row["equivalent"] else "equivalence not shown"
        chance = f"p = {row['p']:.3f}; Wilcoxon p = {row['wilcoxon_p']:.3f}"
        print(f"{row['measure']}\n    X {x['mean']:.3f} sd {x['sd']:.3f}   Y {y['mean']:.3f} sd {y['sd']:.3f}\n"
              f"    X - Y {row['mean']:+.3f}, 90 % interval {row['low']:+.3f} to {row['high']:+.3f}, "
              f"margin {row['margin']:.3f}: {verdict} ({chance})")  # fmt: skip
    print(f"CPU load: X {result['cpu_load'][0]:.1%}, Y {result['cpu_load'][1]:.1%} (0 for scripted brains)")
    for one in result["apart"]:
        print(f"robots of the same seed after {one['seconds']:g} s: {one['median_cm']:.2f} cm apart (median), "
              f"at most {one['max_cm']:.2f} cm")  # fmt: skip
    print(f"Published: {result['published']}")
    return 0
