"""Report of several runs in Markdown: the tables of docs/experiment-appendix.md §4."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from arena.analysis.comparison import compare_runs, mean_load, series_by_seed
from arena.analysis.statistics import pairs_needed
from arena.trial.record import Trial

Runs = Mapping[str, list[Trial]]
BEGIN: Final = "<!-- results: written by `arena report`; what is between the two marks is replaced -->"
END: Final = "<!-- end of results -->"
PAIRS_SHOWN: Final = 20
"""Maximum number of pairs that a table shows; `arena compare --json` lists all."""


def by_controller(runs: Runs) -> dict[str, dict[str, list[Trial]]]:
    """Group runs by controller, in alphabetical order."""
    groups: dict[str, dict[str, list[Trial]]] = {}
    for name, trials in runs.items():
        groups.setdefault(trials[0].about["controller"], {})[name] = trials
    return dict(sorted(groups.items()))


def report(runs: Runs, figures: Mapping[str, list[str]], host_s: Mapping[str, float], at: float) -> str:
    """Return the report of some runs.

    `figures` are paths of pictures by controller, `host_s` the mean host time of a trial in s by run, and `at` the time
    of the primary measure in s. Raises ValueError for trials that are too short."""
    parts = []
    for controller, group in by_controller(runs).items():
        parts.append(f"### Controller {controller}")
        parts.append(_runs_table(group, host_s, at))
        parts += _equivalence_tables(group, at)
        parts += [f"![controller {controller}]({address})" for address in figures.get(controller, [])]
        parts += _faults(group)
    published = {trials[0].experiment.published for trials in runs.values()} - {""}
    parts += [f"Published: {one}." for one in sorted(published)]
    return "\n\n".join(part for part in parts if part) + "\n"


def with_results(document: str, text: str) -> str:
    """Return a document with the text between BEGIN and END replaced. Raises ValueError without these marks."""
    before, begin, rest = document.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the document has no marks for results: {BEGIN!r} ... {END!r}")
    return f"{before}{BEGIN}\n\n{text}\n{END}{after}"


def _runs_table(group: Mapping[str, list[Trial]], host_s: Mapping[str, float], at: float) -> str:
    """Return the table of all measures by run: mean and standard deviation (ddof = 1)."""
    measures = next(iter(group.values()))[0].experiment.measures
    rows = [
        f"| run | n | {' | '.join(one.label.format(at=at) for one in measures)} | CPU load | host s per trial |",
        "|---" * (len(measures) + 4) + "|",
    ]
    for name, trials in group.items():
        done = [one for _, one in series_by_seed(trials).values()]
        cells = [_spread([one.of(series, at) for series in done]) for one in measures]
        load = mean_load(trials)
        rows.append(f"| {name} | {len(done)} | {' | '.join(cells)} | {'-' if load is None else f'{load:.1%}'} | "
                    f"{host_s[name]:.0f} |")  # fmt: skip
    return "\n".join(rows)


def _spread(values: list[float]) -> str:
    """Return mean and standard deviation as text."""
    digits = 3 if max(values) <= 1 else 0
    deviation = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
    return f"{np.mean(values):.{digits}f} ± {deviation:.{digits}f}"


def _equivalence_tables(group: Mapping[str, list[Trial]], at: float) -> list[str]:
    """Return the pre-registered table of equivalence tests, and a second one: exact intervals, pairs and remarks."""
    registered = [
        "| X - Y, same seeds | measure | difference | 90 % interval | margin | equivalent | Wilcoxon p | pairs for 80 %"
        " power |",
        "|---|---|---|---|---|---|---|---|",
    ]
    added = [
        "Added to the registered rules: the test of sign flips, and every pair.",
        "",
        "| X - Y | measure | exact 90 % interval | p | smallest possible p | X - Y by seed | remark |",
        "|---|---|---|---|---|---|---|",
    ]
    for (first, ones), (second, others) in itertools.combinations(group.items(), 2):
        if len(set(series_by_seed(ones)) & set(series_by_seed(others))) < 2:
            continue
        for row in compare_runs(ones, others, at)["measures"]:
            digits = 3 if row["margin"] < 1 else 1
            verdict = "yes" if row["equivalent"] else "not shown"
            registered.append(f"| {first} - {second}, {row['count']} | {row['measure']} | {row['mean']:+.{digits}f} | "
                              f"{row['low']:+.{digits}f} to {row['high']:+.{digits}f} | {row['margin']:.{digits}f} | "
                              f"{verdict} | {row['wilcoxon_p']:.2f} | {pairs_needed(row['deviation'], row['margin'])} |"
                              )  # fmt: skip
            exact, pairs = row["exact"], [one - other for one, other in row["pairs"]]
            shown = " ".join(f"{one:+.{digits}f}" if one else "0" for one in pairs[:PAIRS_SHOWN])
            more = f" and {len(pairs) - PAIRS_SHOWN} more" if len(pairs) > PAIRS_SHOWN else ""
            added.append(f"| {first} - {second} | {row['measure']} | {exact['low']:+.{digits}f} to "
                         f"{exact['high']:+.{digits}f} | {exact['p']:.2f} | {exact['least_p']:.2g} | {shown}{more} | "
                         f"{row['remark']} |")  # fmt: skip
    return ["\n".join(registered), "\n".join(added)] if len(registered) > 2 else []


def _faults(group: Mapping[str, list[Trial]]) -> list[str]:
    """Return a line per fault of a robot."""
    lines: list[str] = []
    for name, trials in group.items():
        faults: list[Any] = [(trial.path.stem, fault) for trial in trials for fault in trial.about["faults"]]
        lines += [f"{name}, {trial}: {seconds:.1f} s: robot {robot} {why}"
                  for trial, (robot, seconds, why) in faults]  # fmt: skip
    return lines
