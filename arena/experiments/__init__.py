"""Experiments: what is measured, and what a supervisor does. What enters: a name or the path of a Python file; what
leaves: an `Experiment`, which drives run, compare, plot, report and replay.

A file defines `metrics(sample)` and, where it wants them, `CURVES`, `MEASURES`, `PUBLISHED`, `groups(scene, objects)`,
and of a supervisor `init(world)`, `step(world)`, `done(world)`. `clustering.py` here is an example with everything but
a supervisor. Modules of the entry point `openswarm.experiments` are found by their name.
"""

from __future__ import annotations

import hashlib
import importlib.util
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arena.metrics import Course
from arena.scene.loader import Scene, SceneError

FOLDER: Final = Path(__file__).parent / "builtin"
PLAIN: Final = "plain"
"""What scenes are measured by that name no experiment."""
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """A metric over time. `scale` turns it into `unit` for people; `best` is the value nothing can exceed;
    `reference` a published value and where it is from, drawn as a line."""

    name: str
    label: str
    unit: str = ""
    scale: float = 1.0
    best: float | None = None
    reference: tuple[float, str] | None = None

    def shown(self, value: float) -> str:
        """A value in its unit."""
        scaled = value * self.scale
        digits = 0 if abs(scaled) >= 100 or self.unit == "%" else 1 if abs(scaled) >= 10 else 2
        return f"{scaled:.{digits}f}{f' {self.unit}' if self.unit else ''}"


@dataclass(frozen=True)
class Measure:
    """One number of a trial: `of(course, at)`, `at` the time in s that was asked for. Two runs are equivalent in it if
    they differ by less than `margin`, None: by less than 10 % of the second run's mean."""

    name: str
    label: str
    of: Callable[[Course, float], float]
    margin: float | None = None
    best: float | None = None


@dataclass(frozen=True)
class Sample:
    """One moment of a trial: robots n x 3 (cm, cm, rad), objects n x 2 (cm), what the supervisor noted."""

    t: float
    robots: Floats
    objects: Floats
    scene: Scene
    noted: Mapping[str, float]


class Said(NamedTuple):
    """A line that a robot wrote to UART1; its first byte began to leave after `seconds` of the trial."""

    robot: int
    seconds: float
    text: str


@dataclass(frozen=True)
class Moments:
    """All samples of a trial at once: `robots` is samples x n x 3, `objects` samples x n x 2."""

    times: Floats
    robots: Floats
    objects: Floats
    scene: Scene
    noted: Mapping[str, Floats]
    said: Sequence[Said] = ()
    """What robots wrote to UART1, in its order."""


def _nothing(_world: Any) -> None:
    """A supervisor that lets things happen."""


def _never(_world: Any) -> bool:
    return False


def _alone(_scene: Scene, objects: Floats) -> list[int]:
    return list(range(len(objects)))


@dataclass(frozen=True)
class Experiment:
    """What is measured, and what a supervisor does. `groups` tells which objects belong together, for their colours."""

    name: str
    curves: tuple[Curve, ...]
    measures: tuple[Measure, ...]
    all_curves: Callable[[Moments], Mapping[str, Floats]]
    published: str = ""
    groups: Callable[[Scene, Floats], list[int]] = _alone
    init: Callable[[Any], None] = _nothing
    step: Callable[[Any], None] = _nothing
    done: Callable[[Any], bool] = _never
    digest: str = field(default="", compare=False)
    """SHA-256 of the file, if it does not come along with the arena."""

    @property
    def has_supervisor(self) -> bool:
        """Whether anything is done during a trial."""
        return (self.init, self.step, self.done) != (_nothing, _nothing, _never)

    @property
    def has_groups(self) -> bool:
        """Whether objects can belong together."""
        return self.groups is not _alone

    def course(self, moments: Moments) -> Course:
        """The metrics of a trial over time. Raises SceneError if the experiment fails or returns something else."""
        try:
            found = self.all_curves(moments)
            values = {one.name: np.asarray(found[one.name], dtype=float) for one in self.curves}
        except (Exception, SystemExit) as error:
            raise SceneError(f"experiment {self.name}: metrics: {type(error).__name__}: {error}") from error
        wrong = [name for name, one in values.items() if one.shape != moments.times.shape]
        if wrong:
            raise SceneError(f"experiment {self.name}: metrics {', '.join(wrong)}: expected one number per sample")
        return Course(moments.times, values)

    def curve(self, name: str) -> Curve:
        """A curve by its name. Raises KeyError."""
        return next(one for one in self.curves if one.name == name)


def experiment_of(name: str, folder: Path = Path()) -> Experiment:
    """The experiment of that name, or of the Python file at a path (relative to `folder`). Raises SceneError."""
    if name.endswith(".py"):
        return _of_file((folder / name).resolve())
    return _of_name(name)


def experiment_file(name: str, folder: Path) -> Path | None:
    """The file of an experiment that does not come along; None for one that does. Raises SceneError as
    `experiment_of`."""
    experiment_of(name, folder)
    return (folder / name).resolve() if name.endswith(".py") else None


@cache
def _of_name(name: str) -> Experiment:
    if re.fullmatch("[a-z][a-z_]*", name) and (FOLDER / f"{name}.py").is_file():
        return _experiment(name, importlib.import_module(f"arena.experiments.builtin.{name}"), "")
    for point in entry_points(group="openswarm.experiments"):
        if point.name == name:
            module = point.load()
            return _experiment(name, module, _digest(Path(str(module.__file__))))
    known = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem[0] != "_")
    raise SceneError(f"there is no experiment {name!r}; known: {', '.join(known)}, or the path of a .py file")


@cache
def _of_file(path: Path) -> Experiment:
    spec = importlib.util.spec_from_file_location(f"arena_experiment_{_name(path)}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise SceneError(f"{path}: there is no such experiment file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module  # dataclasses look their module up
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        line = getattr(error, "lineno", None) or _line_in(path, error)
        raise SceneError(f"{path}:{line or 1}: {type(error).__name__}: {error}") from None
    return _experiment(path.stem, module, _digest(path))


def _name(path: Path) -> str:
    return re.sub(r"\W", "_", str(path))


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _line_in(path: Path, error: BaseException) -> int | None:
    """The last line of the file that led to an error."""
    line, trace = None, error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(path):
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


def _experiment(name: str, module: ModuleType, digest: str) -> Experiment:
    metrics: Any = getattr(module, "metrics", None)
    whole = getattr(module, "all_curves", None)
    if whole is None and not callable(metrics):
        raise SceneError(
            f"{module.__file__}: an experiment needs a function metrics(sample), which returns numbers by name"
        )
    curves = tuple(getattr(module, "CURVES", ()))
    if not curves:
        raise SceneError(f"{module.__file__}: CURVES names the metrics: CURVES = [Curve('name', 'what people read')]")
    measures = tuple(getattr(module, "MEASURES", ())) or tuple(map(_at, curves))
    hooks = {hook: getattr(module, hook) for hook in ("groups", "init", "step", "done") if hasattr(module, hook)}
    return Experiment(name, curves, measures, whole or _one_by_one(metrics), getattr(module, "PUBLISHED", ""),
                      digest=digest, **hooks)  # fmt: skip


def _at(curve: Curve) -> Measure:
    """A curve's value at the time asked for."""
    return Measure(curve.name, f"{curve.label} at {{at:g}} s", lambda course, at: course.at(at, curve.name),
                   best=curve.best)  # fmt: skip


def _one_by_one(metrics: Callable[[Sample], Mapping[str, float]]) -> Callable[[Moments], Mapping[str, Floats]]:
    """All curves by asking for each sample."""

    def curves(all_of: Moments) -> Mapping[str, Floats]:
        found: dict[str, list[float]] = {}
        for index, t in enumerate(all_of.times):
            noted = {name: float(values[index]) for name, values in all_of.noted.items()}
            sample = Sample(float(t), all_of.robots[index], all_of.objects[index], all_of.scene, noted)
            for name, value in metrics(sample).items():
                found.setdefault(name, []).append(float(value))
        return {name: np.array(values) for name, values in found.items()}

    return curves


def names(experiments: Sequence[Experiment]) -> str:
    """Of several, for people."""
    return ", ".join(sorted({one.name for one in experiments}))
