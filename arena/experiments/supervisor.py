"""Supervisor of a trial: reads and changes the world, sends messages to robots, records numbers, ends the trial.

The functions `init`, `step` and `done` of an experiment receive a `Supervisor`. Its actions are part of the trial, and
equal seeds give equal records.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from arena.experiments import Experiment
from arena.robots.controller import Controller
from arena.scene.loader import Scene, SceneError
from arena.scene.placement import obstruction, outlines_of
from arena.world.physics import COLLISION_SLOP, STREAM_EXPERIMENT, World, generator

STEP_S: Final = 0.1
"""Simulated seconds between two calls of `step`, each at the end of the nearest quantum."""
T = TypeVar("T")


class Supervisor:
    """Access of an experiment to its running trial.

    `rng` is a random generator for the experiment, and `memory` holds its own state."""

    def __init__(self, world: World, controllers: Sequence[Controller], seed: int) -> None:
        self._world: Final = world
        self._controllers: Final = controllers
        self.rng: Final = generator(seed, STREAM_EXPERIMENT)
        self.memory: Final[dict[str, Any]] = {}
        self.noted: Final[dict[str, float]] = {}
        """Numbers by name; every sample of the record stores them as columns `n_NAME`."""

    @property
    def scene(self) -> Scene:
        """Scene of the trial."""
        return self._world.scene

    @property
    def seconds(self) -> float:
        """Simulated seconds since the start."""
        return self._world.seconds

    @property
    def ticks(self) -> int:
        """Number of completed quanta."""
        return self._world.ticks

    def seconds_at(self, tick: int) -> float:
        """Return the simulated seconds after `tick` quanta."""
        return self._world.seconds_at(tick)

    @property
    def robots(self) -> NDArray[np.float64]:
        """Poses of the robots, n x 3: x and y in cm, heading in rad."""
        return np.array(self._world.poses.robots, dtype=float).reshape(-1, 3)

    @property
    def objects(self) -> NDArray[np.float64]:
        """Centres of the objects, n x 2, in cm."""
        return self._world.object_places()

    def note(self, name: str, value: float) -> None:
        """Record a number under a name.

        Raises SceneError for a name that `init` has not noted, because the columns of a record are fixed."""
        if self._world.ticks and name not in self.noted:
            raise SceneError(f"note {name!r}: init must note every name first")
        self.noted[name] = float(value)

    def move_object(self, number: int, x_cm: float, y_cm: float, heading: float | None = None) -> None:
        """Place an object at rest at a position, a polygon with `heading` in rad if given.

        Raises SceneError if it is outside the room, in an obstacle or in another body; IndexError for a wrong number.
        """
        number = range(len(self._world.objects))[number]
        self._check_free(len(self._world.robots) + number, f"object {number}", x_cm, y_cm)
        self._world.move(self._world.objects[number], x_cm, y_cm, _checked(f"object {number}", heading))

    def move_robot(self, number: int, x_cm: float, y_cm: float, heading: float | None = None) -> None:
        """Place a robot at a position, with `heading` in rad if given. Raises as `move_object`."""
        number = range(len(self._world.robots))[number]
        turned = _checked(f"robot {number}", heading)
        self._check_free(number, f"robot {number}", x_cm, y_cm)
        self._world.move(self._world.robots[number], x_cm, y_cm, turned)

    def tell(self, robot: int, text: str) -> None:
        """Send text to a robot by Bluetooth. A scripted robot ignores it."""
        self._controllers[robot].feed_uart(text.encode("latin-1"))

    def _check_free(self, disc: int, name: str, x: float, y: float) -> None:
        """Raise SceneError if a body cannot be at a position. `disc` is its index, robots first."""
        poses = self._world.poses
        discs = [(robot[0], robot[1], self.scene.robot_kind(n).radius_cm) for n, robot in enumerate(poses.robots)]
        discs += [(place[0], place[1], self.scene.kind_of(n).radius_cm) for n, place in enumerate(poses.objects)]
        radius = discs.pop(disc)[2] - COLLISION_SLOP
        why = obstruction(self.scene, outlines_of(self.scene), discs, x, y, radius)
        if why:
            raise SceneError(f"{name} at ({x:g}, {y:g}) cm {why}; choose a free place")


def _checked(name: str, heading: float | None) -> float | None:
    """Return a heading in rad. Raises SceneError for a number that is not finite."""
    if heading is not None and not math.isfinite(heading):
        raise SceneError(f"{name}: heading {heading} rad: expected a finite number")
    return heading


class SupervisorHooks:
    """Calls the supervisor functions of an experiment at their times; does nothing without such functions."""

    def __init__(self, experiment: Experiment | None, supervisor: Supervisor) -> None:
        self._experiment: Final = experiment if experiment is not None and experiment.has_supervisor else None
        self.supervisor: Final = supervisor
        self._steps = 1
        if self._experiment is not None:
            self._call("init", self._experiment.init)

    def is_due(self, tick: int) -> bool:
        """Whether `step` is due after `tick` quanta."""
        return self._experiment is not None and self.supervisor.seconds_at(tick) >= self._steps * STEP_S - 1e-9

    def step(self) -> bool:
        """Call `step` and `done` if they are due after the present quantum; return whether the trial is done."""
        if self._experiment is None or not self.is_due(self.supervisor.ticks):
            return False
        self._steps += 1
        self._call("step", self._experiment.step)
        return bool(self._call("done", self._experiment.done))

    def _call(self, name: str, hook: Callable[[Supervisor], T]) -> T:
        """Call a function of the experiment; report an exception in it as SceneError."""
        try:
            return hook(self.supervisor)
        except SceneError:
            raise
        except (Exception, SystemExit) as error:
            assert self._experiment is not None
            words = f"{type(error).__name__}: {error}{_last_line(error)}"
            raise SceneError(f"experiment {self._experiment.name}: {name}: {words}") from error


def _last_line(error: BaseException) -> str:
    """Return file and line at which an exception was raised."""
    trace = error.__traceback__
    if trace is None:
        return ""
    while trace.tb_next is not None:
        trace = trace.tb_next
    return f" ({trace.tb_frame.f_code.co_filename}:{trace.tb_lineno})"
