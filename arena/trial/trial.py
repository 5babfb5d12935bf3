"""One trial: a world, its controllers, and the record of what happens. Each quantum runs the controllers, then the
physics, then the recorder.

The controllers run in the order of the robots' numbers. All of them see the poses at the start of the quantum.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from arena.experiments import Experiment
from arena.experiments.supervisor import Supervisor, SupervisorHooks
from arena.infrared.channel import OpticalChannel
from arena.lockstep.scheduler import LockStep, RunAheadRobot
from arena.robots.bluetooth import BluetoothLinks
from arena.robots.controller import Controller
from arena.scene.loader import Scene
from arena.scene.robot_kind import KILOBOT
from arena.world.physics import World

_OBJECT: Final = ("x", "y", "heading")
"""Columns of an object; only polygons have a heading."""
TO_ALL: Final = -1
"""Receiver in the record of a message that a Kilobot sends to all robots in reach."""
STOPPED: Final = (0.0, 0.0)
"""Wheel speeds of a robot at rest."""


@dataclass
class Rows:
    """Columns of the record, one value per sample. Lengths cm, angles rad, speeds cm/s."""

    columns: dict[str, list[Any]] = field(default_factory=dict)

    def add(self, values: dict[str, Any]) -> None:
        """Append one sample."""
        for name, value in values.items():
            self.columns.setdefault(name, []).append(value)


@dataclass
class TrialResult:
    """The rows of a trial and the faults of its robots as (robot, seconds, description)."""

    rows: Rows
    faults: list[tuple[int, float, str]]


class RunningTrial:
    """A trial that advances from event to event: its world, its controllers, and its record so far.

    `channel` carries the light between the robots. `threads` threads run the robots if all of them can run ahead. A
    robot whose firmware stops stays where it is; the others continue. `experiment` may have a supervisor
    (supervisor.py), which can end the trial. `on_row(row)` is called for every sample. Raises SceneError if the world
    has no room for all bodies or the supervisor fails.
    """

    def __init__(
        self,
        scene: Scene,
        seed: int,
        controllers: Sequence[Controller],
        seconds: float,
        world: World | None = None,
        on_row: Callable[[dict[str, Any]], None] | None = None,
        channel: OpticalChannel | None = None,
        experiment: Experiment | None = None,
        threads: int = 1,
    ) -> None:
        self.world: Final = world or World(scene, seed)
        self.controllers: Final = controllers
        self.quanta: Final = math.ceil(seconds / self.world.dt - 0.5)
        """Length of the trial in quanta."""
        self.per_second: Final = max(round(1 / self.world.dt), 1)
        """Quanta per second."""
        self._hooks: Final = SupervisorHooks(experiment, Supervisor(self.world, controllers, seed))
        self.supervisor: Final = self._hooks.supervisor
        self._links: Final = BluetoothLinks(scene, controllers)
        self._recorder: Final = _Recorder(self.world, controllers, on_row, self.supervisor.noted, self._links)
        self._sample_s: Final = scene.clock.sample_s
        self._recorder.sample([STOPPED] * len(controllers))
        self._samples = 1
        self._lockstep: Final = _lockstep_of(self.world, controllers, channel, threads)
        self._is_ended = False

    @property
    def is_over(self) -> bool:
        """Whether the time is up or the supervisor has ended the trial."""
        return self._is_ended or self.world.ticks >= self.quanta

    @property
    def result(self) -> TrialResult:
        """The rows and faults so far."""
        return TrialResult(self._recorder.rows, self._recorder.faults)

    def advance(self, limit: int | None = None) -> None:
        """Run to the next event (a sample, a supervisor step, a delivery, a whole second), at most to quantum
        `limit`."""
        world = self.world
        if self._lockstep is not None:
            until = world.ticks + 1
            last = self.quanta if limit is None else min(self.quanta, limit)
            while until < last and not self._is_due(until):
                until += 1
            wheels = self._lockstep.advance(until)
        else:
            wheels = [controller.control_step(world.ticks, world.poses) for controller in self.controllers]
            world.step(wheels)
        if self._links.is_due(world.ticks):
            self._links.deliver(world.ticks)
        self._is_ended = self._hooks.step()
        self.refresh_poses()
        if self._is_ended or self._is_sample(world.ticks):
            self._recorder.sample(wheels)
            self._samples += 1

    def refresh_poses(self) -> None:
        """Use the world's new poses after a body was moved between two quanta."""
        if self._lockstep is not None:
            self._lockstep.refresh_poses()

    def _is_due(self, tick: int) -> bool:
        """Whether the trial must stop after `tick` quanta, before the next one."""
        is_own = tick % self.per_second == 0 or self._is_sample(tick)
        return is_own or self._hooks.is_due(tick) or self._links.is_due(tick)

    def _is_sample(self, tick: int) -> bool:
        """Whether the end of this quantum is the nearest one to the time of the next sample."""
        return self.world.seconds_at(tick) >= self._samples * self._sample_s - self.world.dt / 2


def run_trial(
    scene: Scene,
    seed: int,
    controllers: Sequence[Controller],
    seconds: float,
    progress: Callable[[float], None] | None = None,
    world: World | None = None,
    on_row: Callable[[dict[str, Any]], None] | None = None,
    channel: OpticalChannel | None = None,
    experiment: Experiment | None = None,
    threads: int = 1,
) -> TrialResult:
    """Run a trial of `seconds` to its end; call `progress(seconds)` once per simulated second.

    The other parameters and the exceptions are those of `RunningTrial`.
    """
    running = RunningTrial(scene, seed, controllers, seconds, world, on_row, channel, experiment, threads)
    while not running.is_over:
        running.advance()
        if progress is not None and running.world.ticks % running.per_second == 0:
            progress(running.world.seconds)
    return running.result


def has_messages(scene: Scene) -> bool:
    """Whether a record of the scene has a column of messages: it has Bluetooth links or Kilobots."""
    return bool(scene.bluetooth.links) or any(group.kind == KILOBOT.name for group in scene.groups)


def _lockstep_of(
    world: World, controllers: Sequence[Controller], channel: OpticalChannel | None, threads: int
) -> LockStep | None:
    """Return demand lock-step if every robot can run ahead, else None."""
    robots = [controller for controller in controllers if isinstance(controller, RunAheadRobot)]
    if not controllers or len(robots) < len(controllers):
        return None
    return LockStep(world, robots, channel, threads=threads)


class _Recorder:
    """Turns the present state into rows of the record."""

    def __init__(
        self,
        world: World,
        controllers: Sequence[Controller],
        on_row: Callable[[dict[str, Any]], None] | None,
        noted: Mapping[str, float],
        links: BluetoothLinks,
    ) -> None:
        self._on_row = on_row
        self._noted = noted
        self._has_messages = has_messages(world.scene)
        self._links = links
        self._world = world
        self._controllers = controllers
        self.rows = Rows()
        self.faults: list[tuple[int, float, str]] = []

    def sample(self, wheels: Sequence[tuple[float, float]]) -> None:
        """Add one row. Values are rounded to 1e-4 cm and rad, which halves the file and is far below any effect."""
        world = self._world
        row: dict[str, Any] = {"t": round(world.seconds, 6)}
        for index, place in enumerate(world.object_poses()):
            row |= {f"o{index}_{name}": round(value, 4) for name, value in zip(_OBJECT, place, strict=False)}
        log, lights, messages = [], [], self._links.take_messages()
        for index, controller in enumerate(self._controllers):
            row |= self._robot_columns(index, controller, world.poses.robots[index], wheels[index])
            log += [{"robot": index, "cycle": line.cycle, "text": line.text} for line in controller.take_lines()]
            messages += [{"robot": index, "to": TO_ALL, "cycle": message.cycle, "text": message.text}
                         for message in controller.take_messages()]  # fmt: skip
            lights += [
                {"robot": index, "cycle": change.cycle, "leds": change.leds}
                for change in controller.take_led_changes()
            ]  # fmt: skip
        row["log"], row["lights"] = log, lights
        if self._has_messages:
            row["messages"] = messages
        row |= {f"n_{name}": value for name, value in self._noted.items()}
        self.rows.add(row)
        if self._on_row is not None:
            self._on_row(row)

    def _robot_columns(
        self, index: int, controller: Controller, pose: tuple[float, float, float], speeds: tuple[float, float]
    ) -> dict[str, Any]:
        """Return the columns of one robot, and keep its fault if it is new."""
        reading = controller.reading()
        if reading.fault and (index, reading.fault) not in {(robot, fault) for robot, _, fault in self.faults}:
            self.faults.append((index, self._world.seconds, reading.fault))
        columns = {
            "x": round(pose[0], 4),
            "y": round(pose[1], 4),
            "heading": round(pose[2], 4),
            "left": round(speeds[0], 4),
            "right": round(speeds[1], 4),
            "seen": reading.seen,
            "load": round(reading.load, 4),
            "leds": reading.leds,
            "strip": reading.strip,
            "infrared": reading.infrared,
        }
        return {f"r{index}_{name}": value for name, value in columns.items()}
