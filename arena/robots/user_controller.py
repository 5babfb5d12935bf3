"""Controllers in Python files of users.

A file defines a class `Controller`. `__init__(robot, rng)` gets the number of the robot and a random generator that
depends on the seed of the trial and the robot. `step(senses)` gets the `Senses` of the robot every `PERIOD_S` seconds
and returns the speeds of the left and the right wheel in cm/s. `PERIOD_S` is 0.1 if the file does not define it.

Installed packages register such modules under the entry point `openswarm.controllers`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from arena.robots.controller import ControllerWithoutUart, Reading
from arena.robots.reactive import SPEED_TABLES
from arena.robots.senses import SenseReader, Senses
from arena.scene import dimensions
from arena.scene.loader import FCY, Scene, SceneError
from arena.scene.user_file import line_of, read_user_file, run_module
from arena.world.physics import STREAM_CONTROLLERS, generator
from arena.world.poses import Poses

BUILTIN: Final = Path(__file__).with_name("builtin")
DEFAULT_PERIOD_S: Final = 0.1
FASTEST_PERIOD_S, SLOWEST_PERIOD_S = 0.001, 60.0


def controller_file(name: str, folder: Path = Path()) -> Path:
    """Return the file of a user's controller, which is run once to check it.

    `name` is the path of a Python file relative to `folder`, a module of `builtin`, or an entry point. Raises
    SceneError for other names."""
    if name.endswith(".py"):
        path = (folder / name).resolve()
        load_controller(path)
        return path
    if name.isidentifier() and (BUILTIN / f"{name}.py").is_file():
        return BUILTIN / f"{name}.py"
    for point in entry_points(group="openswarm.controllers"):
        if point.name == name:
            module: ModuleType = point.load()
            return Path(str(module.__file__)).resolve()
    known = ", ".join((*sorted(SPEED_TABLES), *sorted(path.stem for path in BUILTIN.glob("[a-z]*.py"))))
    raise SceneError(f"unknown controller {name!r}; expected {known}, the path of a .py "
                     "file, or an entry point of openswarm.controllers")  # fmt: skip


class LoadedController:
    """The class and the period of a user's file."""

    def __init__(self, path: Path, module: ModuleType) -> None:
        self.path: Final = path
        make: Any = getattr(module, "Controller", None)
        if not isinstance(make, type) or not callable(getattr(make, "step", None)):
            raise SceneError(f"{path}: expected a class Controller with the methods __init__(self, robot, rng) "
                             "and step(self, senses)")  # fmt: skip
        self.make: Final[Callable[..., Any]] = make
        period = getattr(module, "PERIOD_S", DEFAULT_PERIOD_S)
        if not isinstance(period, (int, float)) or not FASTEST_PERIOD_S <= period <= SLOWEST_PERIOD_S:
            raise SceneError(f"{path}: PERIOD_S is {period!r:.40}; "
                             f"expected {FASTEST_PERIOD_S:g} to {SLOWEST_PERIOD_S:g} seconds")  # fmt: skip
        self.period_s: Final = float(period)


def load_controller(path: Path, digest: str | None = None) -> LoadedController:
    """Load a user's controller; with `digest`, only a file with this SHA-256. Raises SceneError."""
    return LoadedController(path, run_module(path, read_user_file(path, "controller", digest)))


class Policy:
    """One robot's instance of a user's controller. Its errors and invalid answers are raised as SceneError."""

    def __init__(self, loaded: LoadedController, seed: int, robot: int) -> None:
        self._path: Final = loaded.path
        self._robot: Final = robot
        self._own: Final = self._call(lambda: loaded.make(robot, generator(seed, STREAM_CONTROLLERS, robot)))

    def step(self, senses: Senses) -> tuple[float, float]:
        """Return the wheel speeds in cm/s, limited to those of the robot."""
        answer = self._call(lambda: self._own.step(senses))
        try:
            left, right = (float(speed) for speed in answer)
        except (TypeError, ValueError):
            left = right = math.nan
        if not (math.isfinite(left) and math.isfinite(right)):
            raise SceneError(f"{self._path}: robot {self._robot}: step returned {answer!r:.60}; expected two numbers, "
                             "the speeds of the left and the right wheel in cm/s")  # fmt: skip
        most = dimensions.WHEEL_SPEED
        return max(-most, min(left, most)), max(-most, min(right, most))

    def _call(self, function: Callable[[], Any]) -> Any:
        try:
            return function()
        except (Exception, SystemExit) as error:
            where = f"{self._path}:{line_of(error, self._path)}"
            raise SceneError(f"{where}: robot {self._robot}: {type(error).__name__}: {error}") from None


class UserController(ControllerWithoutUart):
    """A user's controller in a trial. It senses at the start of a quantum; its wheel speeds hold until the next step.

    A robot whose battery is removed stays at rest (`start.off`)."""

    def __init__(self, scene: Scene, seed: int, robot: int, loaded: LoadedController) -> None:
        self._quantum_s: Final = scene.clock.quantum_tcy / FCY
        self._period: Final = max(round(loaded.period_s / self._quantum_s), 1)
        self._off_tick: Final = scene.off_tick(robot)
        self._reader: Final = SenseReader(scene, seed, robot)
        self._policy: Final = Policy(loaded, seed, robot)
        self._wheels = (0.0, 0.0)
        self._reading = Reading()

    def control_step(self, tick: int, poses: Poses) -> tuple[float, float]:
        """As `Controller.control_step`."""
        if tick >= self._off_tick:
            self._reading = Reading()
            return 0.0, 0.0
        if tick % self._period == 0:
            senses = self._reader.read(poses, tick * self._quantum_s, self._wheels)
            self._reading.seen = senses.seen
            self._wheels = self._policy.step(senses)
        return self._wheels

    def reading(self) -> Reading:
        """As `Controller.reading`."""
        return self._reading
