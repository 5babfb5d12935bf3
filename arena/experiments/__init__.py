"""Experiments: the metrics of a trial, and the functions of its supervisor.

`experiment_of` loads an experiment by name, or from the path of a Python file. The file must define `metrics(sample)`
and `CURVES`. It may define `MEASURES`, `PUBLISHED`, `groups(scene, objects)`, and the functions of a supervisor:
`init(world)`, `step(world)` and `done(world)`. `builtin/clustering.py` is an example without a supervisor,
`builtin/foraging.py` one with a supervisor. Installed packages register modules under the entry point
`openswarm.experiments`.

    >>> from arena.experiments import experiment_of
    >>> experiment = experiment_of("clustering")            # an Experiment
    >>> [curve.name for curve in experiment.curves]         # of type Curve
    ['share', 'share_12cm', 'compactness']
    >>> experiment.curves[0].shown(0.95)
    '95 %'
    >>> [measure.name for measure in experiment.measures]   # of type Measure
    ['share', 'share_12cm', 'area', 't80']

`metrics` gets a `Sample`; `Experiment.series` takes the `TrialSamples` of a trial, with `UartLine`s and `LedEvent`s.
"""

from __future__ import annotations

import hashlib
import importlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.metrics import MetricSeries
from arena.scene.loader import Scene, SceneError
from arena.scene.user_file import read_user_file, run_module

FOLDER: Final = Path(__file__).parent / "builtin"
PLAIN: Final = "plain"
"""Experiment of scenes that do not name one."""
Floats = NDArray[np.float64]
_loaded: Final[dict[str, Experiment]] = {}
"""Experiments that this process has loaded from files, by SHA-256."""


@dataclass(frozen=True)
class Curve:
    """Definition of a metric over time.

    `scale` converts a value to `unit`. `best` is the largest possible value. `reference` is a published value, before
    `scale`, and its source; figures show it as a line."""

    name: str
    label: str
    unit: str = ""
    scale: float = 1.0
    best: float | None = None
    reference: tuple[float, str] | None = None

    def shown(self, value: float) -> str:
        """Return a value as text in its unit."""
        scaled = value * self.scale
        digits = 0 if abs(scaled) >= 100 or self.unit == "%" else 1 if abs(scaled) >= 10 else 2
        return f"{scaled:.{digits}f}{f' {self.unit}' if self.unit else ''}"


@dataclass(frozen=True)
class Measure:
    """Definition of one number per trial: `of(series, at)`, where `at` is the requested time in s.

    Two runs are equivalent if they differ by less than `margin`; None stands for 10 % of the second run's mean."""

    name: str
    label: str
    of: Callable[[MetricSeries, float], float]
    margin: float | None = None
    best: float | None = None


@dataclass(frozen=True)
class Sample:
    """One sample of a trial: robots n x 3 (cm, cm, rad), objects n x 2 (cm), and the supervisor's numbers."""

    t: float
    robots: Floats
    objects: Floats
    scene: Scene
    noted: Mapping[str, float]


class UartLine(NamedTuple):
    """A line that a robot sent on UART1; transmission of the first byte started at `seconds`."""

    robot: int
    seconds: float
    text: str


class LedEvent(NamedTuple):
    """A change of a robot's LEDs at `seconds`; `leds` as in a record (arena/README.md)."""

    robot: int
    seconds: float
    leds: int


@dataclass(frozen=True)
class TrialSamples:
    """All samples of a trial: `robots` is samples x n x 3 (cm, cm, rad), `objects` samples x n x 2 (cm)."""

    times: Floats
    robots: Floats
    objects: Floats
    scene: Scene
    noted: Mapping[str, Floats]
    uart_lines: Sequence[UartLine] = ()
    """Lines that the robots sent on UART1, in order of time."""
    led_changes: Sequence[LedEvent] = ()
    """Changes of LEDs, in order of time."""

    def led_states(self) -> NDArray[np.int64]:
        """Return the LEDs of each robot at every sample: samples x robots."""
        found = np.zeros(self.robots.shape[:2], dtype=np.int64)
        for one in self.led_changes:
            found[int(np.searchsorted(self.times, one.seconds)) :, one.robot] = one.leds
        return found


def _do_nothing(_world: Any) -> None:
    """Do nothing: default of `init` and `step`."""


def _never(_world: Any) -> bool:
    return False


def _no_groups(_scene: Scene, objects: Floats) -> list[int]:
    return list(range(len(objects)))


@dataclass(frozen=True)
class Experiment:
    """Metrics of a trial, and the functions of its supervisor.

    `groups` returns a group number per object, by which pages and figures colour the objects."""

    name: str
    curves: tuple[Curve, ...]
    measures: tuple[Measure, ...]
    all_curves: Callable[[TrialSamples], Mapping[str, Floats]]
    published: str = ""
    groups: Callable[[Scene, Floats], list[int]] = _no_groups
    init: Callable[[Any], None] = _do_nothing
    step: Callable[[Any], None] = _do_nothing
    done: Callable[[Any], bool] = _never
    digest: str = field(default="", compare=False)
    """SHA-256 of the file; empty for a built-in experiment."""
    has_default_measures: bool = field(default=False, compare=False)
    """Whether the measures are the values of the curves at the requested time, because the file defines none."""
    is_declaration: bool = False
    """Whether only the declaration in a record is available, without the code."""

    @property
    def has_supervisor(self) -> bool:
        """Whether the experiment defines a function of a supervisor."""
        return (self.init, self.step, self.done) != (_do_nothing, _do_nothing, _never)

    @property
    def has_groups(self) -> bool:
        """Whether the experiment groups objects."""
        return self.groups is not _no_groups

    def series(self, samples: TrialSamples) -> MetricSeries:
        """Return the metrics of a trial over time. Raises SceneError if the experiment fails."""
        try:
            found = self.all_curves(samples)
            values = {one.name: np.asarray(found[one.name], dtype=float) for one in self.curves}
        except (Exception, SystemExit) as error:
            raise SceneError(f"experiment {self.name}: metrics: {type(error).__name__}: {error}") from error
        wrong = [name for name, one in values.items() if one.shape != samples.times.shape]
        if wrong:
            raise SceneError(f"experiment {self.name}: metrics {', '.join(wrong)}: expected one number per sample")
        return MetricSeries(samples.times, values)


def experiment_of(name: str, folder: Path = Path()) -> Experiment:
    """Return the experiment called `name`, or of the Python file `name` relative to `folder`. Raises SceneError."""
    if name.endswith(".py"):
        return _load_file((folder / name).resolve())
    return _load_by_name(name)


def experiment_with_digest(path: Path, digest: str) -> Experiment:
    """Load the experiment of a file. Raises SceneError; a file whose SHA-256 is not `digest` is not executed."""
    return _load_source(path.resolve(), read_user_file(path, "experiment", digest))


def loaded_experiment(digest: str) -> Experiment | None:
    """Return the experiment that this process has loaded from a file with this SHA-256; None if there is none."""
    return _loaded.get(digest)


def experiment_file(name: str, folder: Path) -> Path | None:
    """Return the file of a user's experiment; None for a built-in or installed one. Raises SceneError."""
    experiment_of(name, folder)
    return (folder / name).resolve() if name.endswith(".py") else None


@cache
def _load_by_name(name: str) -> Experiment:
    """Load a built-in or installed experiment."""
    if re.fullmatch("[a-z][a-z_]*", name) and (FOLDER / f"{name}.py").is_file():
        return _experiment_from(name, importlib.import_module(f"arena.experiments.builtin.{name}"), "")
    for point in entry_points(group="openswarm.experiments"):
        if point.name == name:
            module = point.load()
            return _experiment_from(name, module, _digest(Path(str(module.__file__))))
    known = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem[0] != "_")
    raise SceneError(f"unknown experiment {name!r}; known: {', '.join(known)}, or the path of a .py file")


def _load_file(path: Path) -> Experiment:
    """Load a user's experiment from its file."""
    return _load_source(path, read_user_file(path, "experiment"))


@cache
def _load_source(path: Path, source: bytes) -> Experiment:
    """Load a user's experiment from the content of its file."""
    digest = hashlib.sha256(source).hexdigest()
    return _loaded.setdefault(digest, _experiment_from(path.stem, run_module(path, source), digest))


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _experiment_from(name: str, module: ModuleType, digest: str) -> Experiment:
    """Return the experiment that a module defines. Raises SceneError if a definition is missing."""
    metrics: Any = getattr(module, "metrics", None)
    whole = getattr(module, "all_curves", None)
    if whole is None and not callable(metrics):
        raise SceneError(f"{module.__file__}: an experiment must define metrics(sample), which returns numbers by name")
    curves = tuple(getattr(module, "CURVES", ()))
    if not curves:
        raise SceneError(f"{module.__file__}: an experiment must define its metrics: CURVES = [Curve('name', 'label')]")
    own = tuple(getattr(module, "MEASURES", ()))
    measures = own or tuple(map(default_measure, curves))
    hooks = {hook: getattr(module, hook) for hook in ("groups", "init", "step", "done") if hasattr(module, hook)}
    return Experiment(name, curves, measures, whole or _curves_by_sample(metrics), getattr(module, "PUBLISHED", ""),
                      digest=digest, has_default_measures=not own, **hooks)  # fmt: skip


def default_measure(curve: Curve) -> Measure:
    """Return the default measure of a curve: its value at the requested time."""
    return Measure(curve.name, f"{curve.label} at {{at:g}} s", lambda series, at: series.at(at, curve.name),
                   best=curve.best)  # fmt: skip


def _curves_by_sample(
    metrics: Callable[[Sample], Mapping[str, float]],
) -> Callable[[TrialSamples], Mapping[str, Floats]]:
    """Return a function that calls `metrics` for each sample and collects the curves."""

    def curves(all_of: TrialSamples) -> Mapping[str, Floats]:
        found: dict[str, list[float]] = {}
        for index, t in enumerate(all_of.times):
            noted = {name: float(values[index]) for name, values in all_of.noted.items()}
            sample = Sample(float(t), all_of.robots[index], all_of.objects[index], all_of.scene, noted)
            for name, value in metrics(sample).items():
                found.setdefault(name, []).append(float(value))
        return {name: np.array(values) for name, values in found.items()}

    return curves


def names(experiments: Sequence[Experiment]) -> str:
    """Return the names of some experiments, separated by commas."""
    return ", ".join(sorted({one.name for one in experiments}))
