"""Rows to figures; never touches a world. Figure numbers are those of the publication (experiment.md §6)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from arena import bodies
from arena.commands.compare import courses
from arena.metrics import clusters, reach_of
from arena.record import Trial
from arena.statistics import bootstrap_band

Runs = Mapping[str, list[Trial]]
SNAPSHOTS_S: Final = (0.0, 600.0)


def draw_all(runs: Runs, folder: Path, form: str, prefix: str = "", names: Sequence[str] | None = None) -> list[Path]:
    """The figures of some runs, or those in `names`, into `folder`; the files written."""
    matplotlib.use("Agg")
    figures: dict[str, Callable[[Runs], Figure]] = {
        "figure4-snapshots": snapshots,
        "figure5-clustering": clustering,
        "trajectories": trajectories,
        "cpu-load": cpu_load,
    }
    paths = []
    for name, draw in figures.items():
        if names is not None and name not in names:
            continue
        path = folder / f"{prefix}{name}.{form}"
        draw(runs).savefig(path, dpi=120, metadata=None if form != "svg" else {"Date": None})
        paths.append(path)
    return paths


def snapshots(runs: Runs) -> Figure:
    """Figure 4: the first trial of each run at 0 and 10 min (or its end), the largest cluster filled."""
    figure = Figure(figsize=(9, 3.6 * len(runs)), layout="constrained")
    axes = figure.subplots(len(runs), len(SNAPSHOTS_S), squeeze=False)
    for row, (name, trials) in zip(axes, runs.items(), strict=True):
        for axis, seconds in zip(row, SNAPSHOTS_S, strict=True):
            trial = trials[0]
            sample = max(int(np.searchsorted(trial.times, seconds + 1e-6)) - 1, 0)
            _arena(axis, trial, sample)
            axis.set_title(f"{name}, {trial.times[sample]:.0f} s", fontsize=9)
    return figure


def _arena(axis: Axes, trial: Trial, sample: int) -> None:
    scene = trial.about["scene"]
    width, height = scene["arena"]["width_cm"], scene["arena"]["height_cm"]
    radius = scene["objects"]["radius_cm"]
    places = trial.objects[sample]
    labels = clusters(places, reach_of("4r", radius))
    largest = max(set(labels), key=labels.count) if labels else -1
    axis.add_patch(Rectangle((0, 0), width, height, fill=False))
    for (x, y), label in zip(places, labels, strict=True):
        axis.add_patch(Circle((x, y), radius, facecolor="tab:red" if label == largest else "mistyrose", edgecolor="k"))
    for index, (x, y) in enumerate(trial.robots[sample]):
        heading = float(trial.columns[f"r{index}_heading"][sample])
        axis.add_patch(Circle((x, y), bodies.ROBOT_RADIUS, facecolor="tab:green", edgecolor="k"))
        axis.plot([x, x + 6 * np.cos(heading)], [y, y + 6 * np.sin(heading)], "k", linewidth=1)
    axis.set(xlim=(-2, width + 2), ylim=(-2, height + 2), aspect="equal", xticks=[], yticks=[])


def clustering(runs: Runs) -> Figure:
    """Figure 5: (a) share of objects in the largest cluster, (b) compactness; mean, sd and 95 % bootstrap band."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    share_axis, spread_axis = figure.subplots(1, 2)
    for name, trials in runs.items():
        done = [one for _, one in courses(trials).values()]
        samples = min(len(one.times) for one in done)
        times = done[0].times[:samples]
        _band(share_axis, name, times, 100 * np.array([one.share[:samples] for one in done]))
        _band(spread_axis, name, times, np.array([one.compactness[:samples] for one in done]))
    share_axis.axhline(86.5, linestyle=":", color="k", linewidth=1)
    share_axis.set(xlabel="time (s)", ylabel="objects in the largest cluster (%)", ylim=(0, 105),
                   title="(a) dotted: 86.5 % of ref. [10] at 600 s, real robots")  # fmt: skip
    spread_axis.set(xlabel="time (s)", ylabel="compactness u, Eq. (2)", ylim=(0, None), title="(b)")
    share_axis.legend(fontsize=8)
    return figure


def _band(axis: Axes, name: str, times: Any, values: Any) -> None:
    mean, deviation = values.mean(axis=0), values.std(axis=0)
    (line,) = axis.plot(times, mean, label=f"{name} (n = {len(values)})")
    low, high = bootstrap_band(values)
    axis.fill_between(times, low, high, color=line.get_color(), alpha=0.3, linewidth=0)
    axis.plot(times, mean + deviation, "--", times, mean - deviation, "--", color=line.get_color(),
              linewidth=0.6)  # fmt: skip


def trajectories(runs: Runs) -> Figure:
    """Paths of the robots in the first trial of each run."""
    figure = Figure(figsize=(5 * len(runs), 4), layout="constrained")
    for axis, (name, trials) in zip(figure.subplots(1, len(runs), squeeze=False)[0], runs.items(), strict=True):
        scene = trials[0].about["scene"]["arena"]
        paths = trials[0].robots
        for robot in range(paths.shape[1]):
            axis.plot(paths[:, robot, 0], paths[:, robot, 1], linewidth=0.6)
        axis.set(xlim=(0, scene["width_cm"]), ylim=(0, scene["height_cm"]), aspect="equal", title=name)
    return figure


def cpu_load(runs: Runs) -> Figure:
    """Share of cycles the CPU was not idle, mean over robots and trials; 0 for scripted brains."""
    figure = Figure(figsize=(6, 3.5), layout="constrained")
    axis = figure.subplots()
    for name, trials in runs.items():
        samples = min(len(trial.times) for trial in trials)
        loads = [trial.columns[f"r{robot}_load"][1:samples] for trial in trials
                 for robot in range(trial.about["scene"]["robots"]["count"])]  # fmt: skip
        if loads:
            axis.plot(trials[0].times[1:samples], 100 * np.mean(loads, axis=0), label=name, linewidth=0.7)
    axis.set(xlabel="time (s)", ylabel="CPU load (%)")
    axis.legend(fontsize=8)
    return figure
