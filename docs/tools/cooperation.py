"""Draw and summarise the convergence of cooperating swarms from the trials of their scenes, for docs/swarm.md.

    python docs/tools/cooperation.py clocks results/clocks [FOLDER ...] [--figure docs/figures/clocks.png]

Each curve shows the median of the trials and the bands that contain 50 and 90 % of them. The summary states the time at
which each trial reached agreement.
"""

from __future__ import annotations

import argparse
import textwrap
from pathlib import Path

import numpy as np

from arena.experiments import experiment_of
from arena.scene import palette
from arena.trial.record import Trial, trials_in

SETTLED = {"average": "agreed", "clocks": "agreed", "halt": "together", "leader": "elected", "search": "found"}
"""For each experiment, the measure with the time of agreement, which is nan if there is no agreement at the end."""
LOG = {"apart"}


def table(name: str, trials: list[Trial]) -> None:
    experiment = experiment_of(name)
    settled = next(one for one in experiment.measures if one.name == SETTLED[name])
    times = np.array([settled.of(one.series, float(one.times[-1])) for one in trials])
    done = times[~np.isnan(times)]
    seeds = [one.about["seed"] for one, time in zip(trials, times, strict=True) if np.isnan(time)]
    print(f"{len(done)} of {len(trials)} trials settled; not: seeds {seeds or 'none'}")
    if len(done):
        label = settled.label.format(at=float(trials[0].times[-1]))
        print(f"{label}: median {np.median(done):.3g}, {done.min():.3g} to {done.max():.3g}")
    for curve in experiment.curves:
        last = curve.scale * np.array([one.series.last(curve.name) for one in trials])
        least, middle, most = np.nanpercentile(last, [0, 50, 100])
        print(f"{curve.label}, at the end: median {middle:.1f}, {least:.1f} to {most:.1f}")


def draw(path: Path, name: str, trials: list[Trial]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    curves = experiment_of(name).curves
    figure, axes = plt.subplots(1, len(curves), figsize=(5 * len(curves), 3.6), squeeze=False)
    samples = min(len(one.times) for one in trials)
    times = trials[0].times[:samples]
    for axis, curve in zip(axes[0], curves, strict=True):
        values = curve.scale * np.array([one.series.curves[curve.name][:samples] for one in trials])
        known = ~np.isnan(values).all(axis=0)
        for low, high in ((5, 95), (25, 75)):
            bounds = np.nanpercentile(values[:, known], [low, high], axis=0)
            axis.fill_between(times[known], *bounds, color=palette.BLUE, alpha=0.2, linewidth=0)
        axis.plot(times[known], np.nanmedian(values[:, known], axis=0), color=palette.BLUE)
        for _, second in trials[0].scene.start.off:
            axis.axvline(second, color=palette.VERMILION, linestyle=":", linewidth=1)
        axis.set(xlabel="s", xlim=(0, times[-1]))
        axis.set_ylabel(textwrap.fill(f"{curve.label}, {curve.unit}".rstrip(", "), 45), fontsize=8)
        if curve.name in LOG:
            axis.set_yscale("log")
    axes[0][0].set_title(f"{len(trials)} trials: median, 50 and 90 %; red: a robot dies", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=sorted(SETTLED))
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--figure", type=Path)
    chosen = parser.parse_args()
    trials = [trial for folder in chosen.folders for trial in trials_in(folder)]
    table(chosen.name, trials)
    if chosen.figure is not None:
        draw(chosen.figure, chosen.name, trials)


if __name__ == "__main__":
    main()
