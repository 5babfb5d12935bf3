"""One trial: a world, its brains, and rows of what happened. A quantum is: think, act, physics, record, in this order.

Robots think in the order of their numbers; none sees a half-moved world.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from arena.experiments import Experiment
from arena.experiments.supervisor import Stage, Supervised
from arena.infrared.channel import Ether
from arena.lockstep.processes import Crew
from arena.lockstep.scheduler import LockStep, Runner
from arena.robots.bluetooth import Links
from arena.robots.controller import Brain
from arena.scene.loader import Scene
from arena.world.physics import World

STOPPED: Final = (0.0, 0.0)


@dataclass
class Rows:
    """Columns of the record, one value per sample. Lengths cm, angles rad, speeds cm/s."""

    columns: dict[str, list[Any]] = field(default_factory=dict)

    def add(self, values: dict[str, Any]) -> None:
        """Append one sample."""
        for name, value in values.items():
            self.columns.setdefault(name, []).append(value)


@dataclass
class Result:
    """What a trial leaves: rows, and what happened to robots (robot, seconds, what)."""

    rows: Rows
    faults: list[tuple[int, float, str]]


class Running:
    """A trial that goes on when it is told to: a world, its brains, and what of it is recorded.

    Some of the brains may live in other processes, `crews`; `ether` is that of the brains of this one, and so many
    `threads` run them if they can run ahead. A robot whose firmware stops stands still; the others go on. `experiment`
    may have a supervisor (stage.py), who can end the trial. `on_row(row)` is called for every sample. Raises SceneError
    if there is no room or the supervisor fails.
    """

    def __init__(
        self,
        scene: Scene,
        seed: int,
        brains: Sequence[Brain],
        seconds: float,
        world: World | None = None,
        on_row: Callable[[dict[str, Any]], None] | None = None,
        crews: Sequence[Crew] = (),
        ether: Ether | None = None,
        experiment: Experiment | None = None,
        threads: int = 1,
    ) -> None:
        self.world: Final = world or World(scene, seed)
        self.brains: Final = brains
        self.quanta: Final = math.ceil(seconds / self.world.dt - 0.5)
        """After which the trial is over."""
        self.per_second: Final = max(round(1 / self.world.dt), 1)
        self._crews: Final = crews
        self._ether: Final = ether
        self._supervised: Final = Supervised(experiment, Stage(self.world, brains, seed))
        self.stage: Final = self._supervised.stage
        self._links: Final = Links(scene, brains)
        self._recorder: Final = _Recorder(self.world, brains, on_row, self.stage.noted, self._links)
        self._sample_s: Final = scene.clock.sample_s
        self._recorder.sample([STOPPED] * len(brains))
        self._samples = 1
        self._ahead: Final = None if crews else _together(self.world, brains, ether, threads)
        self._is_over = False

    @property
    def is_over(self) -> bool:
        """Whether its time is up or its supervisor has ended it."""
        return self._is_over or self.world.ticks >= self.quanta

    @property
    def result(self) -> Result:
        """What it has left so far."""
        return Result(self._recorder.rows, self._recorder.faults)

    def go_on(self, limit: int | None = None) -> None:
        """To the next moment at which something is due from outside (a sample, the supervisor, a whole second), at most
        until `limit` quanta are over."""
        world = self.world
        if self._ahead is not None:
            until = world.ticks + 1
            last = self.quanta if limit is None else min(self.quanta, limit)
            while until < last and not self._is_due(until):
                until += 1
            wheels = self._ahead.advance(until)
        else:
            wheels = _quantum(world, self.brains, self._crews, self._ether)
        if self._links.is_due(world.ticks):
            self._links.carry(world.ticks)
        self._is_over = self._supervised.is_over()
        self.touched()
        if self._is_over or self._is_sample(world.ticks):
            self._recorder.sample(wheels)
            self._samples += 1

    def touched(self) -> None:
        """Somebody may have moved something since the last quantum."""
        if self._ahead is not None:
            self._ahead.moved()

    def _is_due(self, tick: int) -> bool:
        mine = tick % self.per_second == 0 or self._is_sample(tick)
        return mine or self._supervised.is_due(tick) or self._links.is_due(tick)

    def _is_sample(self, tick: int) -> bool:
        """A sample is the end of the quantum nearest to the time asked."""
        return self.world.seconds_at(tick) >= self._samples * self._sample_s - self.world.dt / 2


def run_trial(
    scene: Scene,
    seed: int,
    brains: Sequence[Brain],
    seconds: float,
    progress: Callable[[float], None] | None = None,
    world: World | None = None,
    on_row: Callable[[dict[str, Any]], None] | None = None,
    crews: Sequence[Crew] = (),
    ether: Ether | None = None,
    experiment: Experiment | None = None,
    threads: int = 1,
) -> Result:
    """Let `brains` live in a new world for `seconds`; `progress(seconds)` is called once per simulated second. The rest
    is that of `Running`, which says what it raises."""
    running = Running(scene, seed, brains, seconds, world, on_row, crews, ether, experiment, threads)
    while not running.is_over:
        running.go_on()
        if progress is not None and running.world.ticks % running.per_second == 0:
            progress(running.world.seconds)
    return running.result


def _together(world: World, brains: Sequence[Brain], ether: Ether | None, threads: int) -> LockStep | None:
    """Demand lock-step, if all robots can run ahead."""
    robots = [brain for brain in brains if isinstance(brain, Runner)]
    return LockStep(world, robots, ether, threads=threads) if brains and len(robots) == len(brains) else None


def _quantum(
    world: World, brains: Sequence[Brain], crews: Sequence[Crew], ether: Ether | None
) -> list[tuple[float, float]]:
    """Think, act, physics; wheel speeds."""
    tick, poses = world.ticks, world.poses
    if crews:
        switches = ether.take() if ether is not None else []
        for crew in crews:
            crew.begin(tick, poses, switches)
    wheels = [brain.think(tick, poses) for brain in brains]
    world.step(wheels)
    return wheels


class _Recorder:
    """Turns the present state into one row."""

    def __init__(
        self,
        world: World,
        brains: Sequence[Brain],
        on_row: Callable[[dict[str, Any]], None] | None,
        noted: Mapping[str, float],
        links: Links,
    ) -> None:
        self._on_row = on_row
        self._noted = noted
        self._links = links
        self._world = world
        self._brains = brains
        self.rows = Rows()
        self.faults: list[tuple[int, float, str]] = []

    def sample(self, wheels: Sequence[tuple[float, float]]) -> None:
        """One row, rounded to 1e-4 cm and rad: far below what matters, and it halves the file."""
        world = self._world
        row: dict[str, Any] = {"t": round(world.seconds, 6)}
        for index, (x, y) in enumerate(world.poses.objects):
            row[f"o{index}_x"], row[f"o{index}_y"] = round(x, 4), round(y, 4)
        said, lit = [], []
        for index, ((x, y, heading), (left, right), brain) in enumerate(
            zip(world.poses.robots, wheels, self._brains, strict=True)
        ):
            reading = brain.reading()
            row[f"r{index}_x"], row[f"r{index}_y"] = round(x, 4), round(y, 4)
            row[f"r{index}_heading"] = round(heading, 4)
            row[f"r{index}_left"], row[f"r{index}_right"] = round(left, 4), round(right, 4)
            row[f"r{index}_seen"] = reading.seen
            row[f"r{index}_load"] = round(reading.load, 4)
            row[f"r{index}_leds"] = reading.leds
            row[f"r{index}_strip"] = reading.strip
            row[f"r{index}_infrared"] = reading.infrared
            if reading.fault and (index, reading.fault) not in {(robot, why) for robot, _, why in self.faults}:
                self.faults.append((index, world.seconds, reading.fault))
            said += [{"robot": index, "cycle": line.cycle, "text": line.text} for line in brain.lines()]
            lit += [{"robot": index, "cycle": change.cycle, "leds": change.leds} for change in brain.lights()]
        row["log"], row["lights"] = said, lit
        row |= self._links.messages()
        row |= {f"n_{name}": value for name, value in self._noted.items()}
        self.rows.add(row)
        if self._on_row is not None:
            self._on_row(row)
