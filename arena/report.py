"""Runs to the tables of docs/experiment.md §4, in Markdown. What enters: recorded trials by run; what leaves: text."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from arena.commands.compare import PUBLISHED, compared, courses, mean_load
from arena.metrics import time_to
from arena.record import Trial
from arena.statistics import pairs_needed

Runs = Mapping[str, list[Trial]]
BEGIN: Final = "<!-- results: written by `arena report`; what is between the two marks is replaced -->"
END: Final = "<!-- end of results -->"


def by_controller(runs: Runs) -> dict[str, dict[str, list[Trial]]]:
    """Runs grouped by their controller, in order."""
    groups: dict[str, dict[str, list[Trial]]] = {}
    for name, trials in runs.items():
        groups.setdefault(trials[0].about["controller"], {})[name] = trials
    return dict(sorted(groups.items()))


def report(runs: Runs, figures: Mapping[str, list[str]], host_s: Mapping[str, float], at: float) -> str:
    """The text for some runs. `figures` are addresses of pictures by controller, `host_s` seconds a trial took on
    average, `at` the time in s of the primary measure. Raises ValueError for trials that are too short."""
    parts = []
    for controller, group in by_controller(runs).items():
        parts.append(f"### Controller {controller}")
        parts.append(_runs_table(group, host_s, at))
        parts.append(_equivalence_table(group, at))
        parts += [f"![controller {controller}]({address})" for address in figures.get(controller, [])]
        parts += _faults(group)
    parts.append(f"Published: {PUBLISHED}.")
    return "\n\n".join(part for part in parts if part) + "\n"


def with_results(document: str, text: str) -> str:
    """A document with what is between its two marks replaced. Raises ValueError if it has no such place."""
    before, begin, rest = document.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the document has no place for results: {BEGIN!r} ... {END!r}")
    return f"{before}{BEGIN}\n\n{text}\n{END}{after}"


def _runs_table(group: Mapping[str, list[Trial]], host_s: Mapping[str, float], at: float) -> str:
    rows = [
        f"| run | n | share at {at:g} s | the same, 12 cm rule | share at the end | mean compactness | 80 % reached,"
        " median time | CPU load | host s per trial |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, trials in group.items():
        done = [one for _, one in courses(trials).values()]
        shares = [
            _spread([one.at(at, one.share) for one in done]),
            _spread([one.at(at, one.share_12cm) for one in done]),
            f"{_spread([float(one.share[-1]) for one in done])} at {min(one.times[-1] for one in done):.0f} s",
            _spread([one.area for one in done]),
        ]
        times = [time_to(one.times, one.share, 0.8) for one in done]
        reached = [time for time in times if not np.isnan(time)]
        middle = f", {np.median(reached):.0f} s" if reached else ""
        load = mean_load(trials)
        rows.append(f"| {name} | {len(done)} | {' | '.join(shares)} | {len(reached)} of {len(done)}{middle} | "
                    f"{f'{load:.1%}' if load else '-'} | {host_s[name]:.0f} |")  # fmt: skip
    return "\n".join(rows)


def _spread(values: list[float]) -> str:
    digits = 3 if max(values) <= 1 else 0
    deviation = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
    return f"{np.mean(values):.{digits}f} ± {deviation:.{digits}f}"


def _equivalence_table(group: Mapping[str, list[Trial]], at: float) -> str:
    rows = [
        "| X - Y, same seeds | measure | difference | 90 % interval | margin | equivalent | Wilcoxon p | pairs for 80 %"
        " power |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (first, ones), (second, others) in itertools.combinations(group.items(), 2):
        if len(set(courses(ones)) & set(courses(others))) < 2:
            continue
        result = compared(ones, others, at)
        for row in result["measures"]:
            digits = 3 if row["margin"] < 1 else 1
            verdict = "yes" if row["equivalent"] else "not shown"
            rows.append(f"| {first} - {second}, {row['count']} | {row['measure']} | {row['mean']:+.{digits}f} | "
                        f"{row['low']:+.{digits}f} to {row['high']:+.{digits}f} | {row['margin']:.{digits}f} | "
                        f"{verdict} | {row['wilcoxon_p']:.2f} | {pairs_needed(row['deviation'], row['margin'])} |"
                        )  # fmt: skip
    return "\n".join(rows) if len(rows) > 2 else ""


def _faults(group: Mapping[str, list[Trial]]) -> list[str]:
    lines: list[str] = []
    for name, trials in group.items():
        faults: list[Any] = [(trial.path.stem, fault) for trial in trials for fault in trial.about["faults"]]
        lines += [f"{name}, {trial}: robot {robot} stopped at {seconds:.1f} s: {why}"
                  for trial, (robot, seconds, why) in faults]  # fmt: skip
    return lines
