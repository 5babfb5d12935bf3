"""Figures of recorded trials: the curves that the experiment declares, snapshots, trajectories and CPU load.

Standard deviations are those of a sample (ddof = 1), as in the tables.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon, Rectangle

from arena.analysis.comparison import series_by_seed
from arena.analysis.statistics import bootstrap_band
from arena.experiments import Curve
from arena.experiments.declaration import code_needed
from arena.scene import geometry, palette
from arena.scene.schema import ObjectKind
from arena.trial.record import Trial

Runs = Mapping[str, list[Trial]]
SNAPSHOTS_S: Final = (0.0, 600.0)
_LEGEND_GREY: Final = "0.4"
"""Colour of the legend's entries for mean, band and deviation, which are the same for all runs."""
NAMES: Final = ("snapshots", "curves", "trajectories", "cpu-load")


def draw_all(runs: Runs, folder: Path, form: str, prefix: str = "", names: Sequence[str] = NAMES) -> list[Path]:
    """Draw the figures `names` of some runs into `folder`, and return the paths.

    Raises ValueError for runs of several experiments."""
    if len({trials[0].experiment for trials in runs.values()}) > 1:
        raise ValueError("the runs are of several experiments; a figure shows one")
    matplotlib.use("Agg")
    figures: dict[str, Callable[[Runs], Figure | None]] = {
        "snapshots": snapshots,
        "curves": curves,
        "trajectories": trajectories,
        "cpu-load": cpu_load,
    }
    paths = []
    for name in names:
        with matplotlib.rc_context({"axes.prop_cycle": cycler(color=palette.LINES)}):
            figure = figures[name](runs)
        if figure is None:
            continue
        path = folder / f"{prefix}{name}.{form}"
        figure.savefig(path, dpi=120, metadata=None if form != "svg" else {"Date": None})
        paths.append(path)
    return paths


def snapshots(runs: Runs) -> Figure:
    """Draw the first trial of each run at 0 and 10 min, or at its end. The largest group of objects is filled."""
    figure = Figure(figsize=(9, 3.6 * len(runs)), layout="constrained")
    axes = figure.subplots(len(runs), len(SNAPSHOTS_S), squeeze=False)
    for row, (name, trials) in zip(axes, runs.items(), strict=True):
        for axis, seconds in zip(row, SNAPSHOTS_S, strict=True):
            trial = trials[0]
            sample = max(int(np.searchsorted(trial.times, seconds + 1e-6)) - 1, 0)
            _arena(axis, trial, sample)
            axis.set_title(f"{name}, seed {trial.about['seed']}, {trial.times[sample]:.0f} s", fontsize=9)
    return figure


def _arena(axis: Axes, trial: Trial, sample: int) -> None:
    places = trial.objects[sample]
    labels = trial.experiment.groups(trial.scene, places)
    largest = max(set(labels), key=labels.count) if labels else -1
    for number, (place, label) in enumerate(zip(trial.object_poses[sample], labels, strict=True)):
        fill = palette.OBJECT if label == largest and labels.count(label) > 1 else palette.PALE_OBJECT
        axis.add_patch(object_patch(trial.scene.kind_of(number), place, fill))
    for index, (x, y) in enumerate(trial.robots[sample]):
        heading = float(trial.columns[f"r{index}_heading"][sample])
        axis.add_patch(Circle((x, y), trial.scene.robot_kind(index).radius_cm, facecolor=palette.ROBOT, edgecolor="k"))
        axis.plot([x, x + 6 * np.cos(heading)], [y, y + 6 * np.sin(heading)], "k", linewidth=1)
    frame(axis, trial)


def object_patch(kind: ObjectKind, place: tuple[float, ...], colour: str) -> Circle | Polygon:
    """Return the outline of an object at x, y in cm and, for a polygon, heading in rad."""
    if kind.polygon:
        corners = geometry.turned(geometry.centred(kind.polygon), *place)
        return Polygon(corners, facecolor=colour, edgecolor="k")
    return Circle((place[0], place[1]), kind.radius_cm, facecolor=colour, edgecolor="k")


def frame(axis: Axes, trial: Trial) -> None:
    """Draw the walls (dashed: the rectangle of a world without walls), and a scale bar of 100, 50 or 10 cm."""
    width, height = trial.scene.arena.width_cm, trial.scene.arena.height_cm
    axis.add_patch(Rectangle((0, 0), width, height, fill=False, linestyle="-" if trial.scene.arena.walls else "--"))
    length = next((one for one in (100, 50, 10) if one <= width / 3), 10)
    edge = 0.06 * height
    axis.plot([width - length, width], [-edge, -edge], "k", linewidth=2, solid_capstyle="butt")
    axis.text(width - length / 2, -1.4 * edge, f"{length} cm", ha="center", va="top", fontsize=7)
    axis.set(xlim=(-2, width + 2), ylim=(-3.4 * edge, height + 2), aspect="equal", xticks=[], yticks=[])
    axis.set_frame_on(False)


def curves(runs: Runs) -> Figure:
    """Draw each metric over time: mean, standard deviation, and 95 % bootstrap band of the mean."""
    experiment = next(iter(runs.values()))[0].experiment
    count = len(experiment.curves)
    if not count:
        raise code_needed(experiment.name, "curves")
    figure = Figure(figsize=(5 * count, 4), layout="constrained")
    axes = figure.subplots(1, count, squeeze=False)[0]
    for number, (axis, curve) in enumerate(zip(axes, experiment.curves, strict=True)):
        for name, trials in runs.items():
            done = [one for _, one in series_by_seed(trials).values()]
            samples = min(len(one.times) for one in done)
            values = curve.scale * np.array([one.curves[curve.name][:samples] for one in done])
            _band(axis, name, done[0].times[:samples], values, curve)
        title = f"({chr(ord('a') + number)})"
        if curve.reference is not None:
            axis.axhline(curve.scale * curve.reference[0], linestyle=":", color="k", linewidth=1)
            title += f" dotted: {curve.reference[1]}"
        axis.set_title(title, fontsize=9)
        axis.set(xlabel="time (s)", ylabel=f"{curve.label}{f' ({curve.unit})' if curve.unit else ''}")
        top = None if curve.best is None else 1.05 * curve.scale * curve.best
        axis.set_ylim(min(axis.get_ylim()[0], 0), top)
        if not number:
            axis.legend(handles=_legend(axis), fontsize=8)
    return figure


def _legend(axis: Axes) -> list[Line2D | Patch]:
    """Return the legend of a figure of curves: the runs, then mean, band and deviation if a run has several trials."""
    runs = [line for line in axis.get_lines() if not str(line.get_label()).startswith("_")]
    if not axis.collections:
        return [*runs]
    mean = Line2D([], [], color=_LEGEND_GREY, label="mean")
    band = Patch(color=_LEGEND_GREY, alpha=0.3, linewidth=0, label="95 % band of the mean")
    deviation = Line2D([], [], color=_LEGEND_GREY, linestyle="--", linewidth=1, label="mean ± sd")
    return [*runs, mean, band, deviation]


def _band(axis: Axes, name: str, times: Any, values: Any, curve: Curve) -> None:
    """Draw one curve with its bands; clip the deviation at the best value, and at 0 if no value is negative."""
    mean = values.mean(axis=0)
    (line,) = axis.plot(times, mean, label=f"{name} (n = {len(values)})")
    if len(values) < 2:
        return
    low, high = bootstrap_band(values)
    axis.fill_between(times, low, high, color=line.get_color(), alpha=0.3, linewidth=0)
    deviation = values.std(axis=0, ddof=1)
    least = 0.0 if values.min() >= 0 else -np.inf
    most = np.inf if curve.best is None else curve.scale * curve.best
    axis.plot(times, np.minimum(mean + deviation, most), "--", times, np.maximum(mean - deviation, least), "--",
              color=line.get_color(), linewidth=0.6)  # fmt: skip


def trajectories(runs: Runs) -> Figure:
    """Draw the paths of the robots in the first trial of each run."""
    figure = Figure(figsize=(5 * len(runs), 4), layout="constrained")
    for axis, (name, trials) in zip(figure.subplots(1, len(runs), squeeze=False)[0], runs.items(), strict=True):
        paths = trials[0].robots
        for robot in range(paths.shape[1]):
            axis.plot(paths[:, robot, 0], paths[:, robot, 1], linewidth=0.6)
            axis.plot(*paths[-1, robot], ".", color=axis.lines[-1].get_color())
        axis.set_title(f"{name}, seed {trials[0].about['seed']}", fontsize=9)
        frame(axis, trials[0])
    return figure


def cpu_load(runs: Runs) -> Figure | None:
    """Draw the mean share of cycles in which the CPU was not idle; None if no run has firmware."""
    figure = Figure(figsize=(6, 3.5), layout="constrained")
    axis = figure.subplots()
    for name, trials in runs.items():
        samples = min(len(trial.times) for trial in trials)
        loads = [trial.columns[f"r{robot}_load"][1:samples] for trial in trials if not trial.is_scripted
                 for robot in range(trial.scene.robots.count)]  # fmt: skip
        if loads:
            axis.plot(trials[0].times[1:samples], 100 * np.mean(loads, axis=0), label=name, linewidth=0.7)
    if not axis.lines:
        return None
    axis.set(xlabel="time (s)", ylabel="CPU load (%)", ylim=(0, None))
    axis.legend(fontsize=8)
    return figure
