"""Print and draw the reproductions of docs/canonical.md from folders of `arena run`.

    python docs/tools/canonical.py results/scripted-10 ... --figure docs/figures/gauci2014.png
    python docs/tools/canonical.py results/square-40 ... --figure docs/figures/chen2015.png

The experiment of the runs, aggregation or transport, decides what is drawn.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from scipy.stats import beta

from arena.analysis.plots import frame
from arena.experiments.builtin.transport import goal_of
from arena.scene import palette
from arena.trial.record import Trial, trials_in

SECONDS = (180.0, 600.0, 900.0)
"""Times of the columns for aggregation."""
Runs = dict[str, list[Trial]]


def aggregation(runs: Runs) -> Figure:
    """Print share in the largest group and dispersion, and draw both over time: mean and range of the trials."""
    figure = Figure(figsize=(10, 3.8), layout="constrained")
    axes = figure.subplots(1, 2)
    columns = "".join(f" share {at:g} s |" for at in SECONDS)
    print(f"| run | trials |{columns} least, most at the end | dispersion at the start | at the end |")
    print("|---|---|" + "---|" * (len(SECONDS) + 3))
    for (name, trials), colour in zip(runs.items(), palette.LINES, strict=False):
        shares = np.array([one.series.curves["cluster"] for one in trials])
        spreads = np.array([one.series.curves["dispersion"] for one in trials])
        at = np.searchsorted(trials[0].times, np.array(SECONDS) - 0.3)
        cells = [f"{100 * shares[:, one].mean():.1f} %" if one < shares.shape[1] else "-" for one in at]
        last = 100 * shares[:, -1]
        print(f"| {name} | {len(trials)} | {' | '.join(cells)} | {last.min():.1f}, {last.max():.1f} % | "
              f"{spreads[:, 0].mean():.0f} | {spreads[:, -1].mean():.0f} |")  # fmt: skip
        for axis, values in zip(axes, (100 * shares, spreads), strict=True):
            axis.fill_between(trials[0].times, values.min(axis=0), values.max(axis=0), color=colour, alpha=0.15, lw=0)
            axis.plot(trials[0].times, values.mean(axis=0), color=colour, lw=1.2, label=f"{name}, n = {len(trials)}")
    axes[0].axhline(98.6, color="k", ls=":", lw=1, label="published: 98.6 %, 40 robots, 30 trials")
    axes[0].set(xlabel="s", ylabel="robots in the largest group, %", ylim=(0, 103))
    axes[1].set(xlabel="s", ylabel="dispersion of the robots, u", yscale="log")
    axes[0].legend(fontsize=7, loc="lower right")
    return figure


def transport(runs: Runs) -> Figure:
    """Print arrivals, and draw the paths of the object and its distance from the goal over time."""
    figure = Figure(figsize=(3.2 * len(runs), 4.6), layout="constrained")
    above, below = figure.subplots(2, len(runs), squeeze=False)
    print("| run | arrived | 95 % interval | s, median | s, least to most | approach / path, median |")
    print("|---|---|---|---|---|---|")
    for column, ((name, trials), colour) in enumerate(zip(runs.items(), palette.LINES, strict=False)):
        ends = np.array([one.times[-1] for one in trials])
        found = np.array([[measure.of(one.series, end) for measure in one.experiment.measures[:2]]
                          for one, end in zip(trials, ends, strict=True)])  # fmt: skip
        there = ~np.isnan(found[:, 0])
        times, count = found[there, 0], int(there.sum())
        spread = f"{np.median(times):.0f} | {times.min():.0f} to {times.max():.0f}" if count else "- | -"
        print(f"| {name} | {count} of {len(trials)} | {interval(count, len(trials))} | {spread} | "
              f"{np.median(found[:, 1]):.2f} |")  # fmt: skip
        axis, curve = above[column], below[column]
        frame(axis, trials[0])
        axis.add_patch(Circle(goal_of(trials[0].scene)[:2], goal_of(trials[0].scene)[2], color=palette.GREEN))
        for one in trials:
            axis.plot(*one.objects[:, 0].T, color=colour, lw=0.7)
            curve.plot(one.times, one.series.curves["distance"], color=colour, lw=0.7)
        axis.set_title(f"{name}: {count} of {len(trials)}", fontsize=9)
        curve.set(xlabel="s", ylabel="cm from the goal" if not column else "", ylim=(0, None))
    return figure


def interval(count: int, trials: int) -> str:
    """Return the 95 % interval (Clopper and Pearson) of the rate of `count` successes in `trials`."""
    low = beta.ppf(0.025, count, trials - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, trials - count) if count < trials else 1.0
    return f"{100 * low:.0f} to {100 * high:.0f} %"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--figure", type=Path)
    chosen = parser.parse_args()
    matplotlib.use("Agg")
    runs = {folder.name: trials_in(folder) for folder in chosen.folders}
    experiment = next(iter(runs.values()))[0].experiment.name
    figure = (aggregation if experiment == "aggregation" else transport)(runs)
    if chosen.figure is not None:
        figure.savefig(chosen.figure, dpi=110)


if __name__ == "__main__":
    main()
