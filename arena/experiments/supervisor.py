"""What a supervisor of an experiment may do: look, move things, tell robots something, note numbers, end a trial.

An experiment's `init`, `step` and `done` get a `Stage`. Everything it does belongs to the trial: the same seed gives
the same bytes, for any number of processes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from arena.experiments import Experiment
from arena.robots.controller import Brain
from arena.scene.loader import Scene, SceneError
from arena.world.physics import STREAM_EXPERIMENT, World, generator

STEP_S: Final = 0.1
"""Between two calls of `step`, at the end of the nearest quantum."""
T = TypeVar("T")


class Stage:
    """A running trial in the hands of its supervisor. `rng` is its own; `memory` is for what it wants to keep."""

    def __init__(self, world: World, brains: Sequence[Brain], seed: int) -> None:
        self._world: Final = world
        self._brains: Final = brains
        self.rng: Final = generator(seed, STREAM_EXPERIMENT)
        self.memory: Final[dict[str, Any]] = {}
        self.noted: Final[dict[str, float]] = {}
        """Numbers by name, recorded with every sample as columns `n_NAME`."""

    @property
    def scene(self) -> Scene:
        """What the trial is made in."""
        return self._world.scene

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return self._world.seconds

    @property
    def ticks(self) -> int:
        """Quanta that are over."""
        return self._world.ticks

    def seconds_at(self, tick: int) -> float:
        """Time after so many quanta."""
        return self._world.seconds_at(tick)

    @property
    def robots(self) -> NDArray[np.float64]:
        """n x 3: cm, cm, rad."""
        return np.array(self._world.poses.robots, dtype=float).reshape(-1, 3)

    @property
    def objects(self) -> NDArray[np.float64]:
        """n x 2, cm."""
        return self._world.object_places()

    def note(self, name: str, value: float) -> None:
        """Set a number. Raises SceneError for a name that was not noted in `init`: a record's columns do not grow."""
        if self._world.ticks and name not in self.noted:
            raise SceneError(f"note {name!r}: names are noted in init first")
        self.noted[name] = float(value)

    def move_object(self, number: int, x_cm: float, y_cm: float) -> None:
        """Put an object somewhere else, at rest. Raises SceneError outside the walls, IndexError for one not there."""
        self._check(x_cm, y_cm)
        self._world.move(self._world.objects[number], x_cm, y_cm)

    def move_robot(self, number: int, x_cm: float, y_cm: float, heading: float | None = None) -> None:
        """Put a robot somewhere else, as a hand would; heading in rad. Raises as `move_object`."""
        self._check(x_cm, y_cm)
        self._world.move(self._world.robots[number], x_cm, y_cm, heading)

    def tell(self, robot: int, text: str) -> None:
        """Send a robot something by Bluetooth. A script does not listen."""
        self._brains[robot].tell(text.encode("latin-1"))

    def _check(self, x: float, y: float) -> None:
        arena = self.scene.arena
        if not (0 < x < arena.width_cm and 0 < y < arena.height_cm):
            raise SceneError(f"({x:g}, {y:g}) cm is outside the walls")


class Supervised:
    """An experiment's supervisor at work on a stage; does nothing where there is none."""

    def __init__(self, experiment: Experiment | None, stage: Stage) -> None:
        self._experiment: Final = experiment if experiment is not None and experiment.has_supervisor else None
        self.stage: Final = stage
        self._steps = 1
        if self._experiment is not None:
            self._call("init", self._experiment.init)

    def is_due(self, tick: int) -> bool:
        """Whether there is something to do after so many quanta."""
        return self._experiment is not None and self.stage.seconds_at(tick) >= self._steps * STEP_S - 1e-9

    def is_over(self) -> bool:
        """After a quantum: step if it is time to; whether the trial is done."""
        if self._experiment is None or not self.is_due(self.stage.ticks):
            return False
        self._steps += 1
        self._call("step", self._experiment.step)
        return bool(self._call("done", self._experiment.done))

    def _call(self, name: str, hook: Callable[[Stage], T]) -> T:
        try:
            return hook(self.stage)
        except SceneError:
            raise
        except (Exception, SystemExit) as error:
            assert self._experiment is not None
            words = f"{type(error).__name__}: {error}{_last_line(error)}"
            raise SceneError(f"experiment {self._experiment.name}: {name}: {words}") from error


def _last_line(error: BaseException) -> str:
    trace = error.__traceback__
    if trace is None:
        return ""
    while trace.tb_next is not None:
        trace = trace.tb_next
    return f" ({trace.tb_frame.f_code.co_filename}:{trace.tb_lineno})"
