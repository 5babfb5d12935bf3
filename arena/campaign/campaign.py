"""Campaigns: run the missing trials of a `Plan` on several workers, and write one file per trial.

A trial is the unit of work. It depends on its plan and seed only, so the number of workers does not affect a file. The
file of a finished trial is kept; an interrupted trial starts again from its seed (experiment-contract.md §3).
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import Thread
from typing import Any

from filelock import FileLock, Timeout

from arena.experiments import Experiment, experiment_of
from arena.experiments.declaration import CURVE_COLUMN, declaration_of
from arena.infrared.channel import OpticalChannel
from arena.replay.live_feed import LiveFile, live_path
from arena.robots.controller import Controller, Program
from arena.scene.loader import Scene, SceneError
from arena.scene.schema import RobotGroup
from arena.trial.manifest import MANIFEST, read_manifest, write_manifest
from arena.trial.record import FolderInUseError, RecordError, Trial, write_trial
from arena.trial.trial import Rows, run_trial
from arena.trial.versions import host, versions
from arena.world.physics import World

Report = Callable[[int, float], None]
"""Progress callback: number of a trial, and its simulated seconds so far."""
_queue: Any = None


@dataclass(frozen=True)
class Plan:
    """Definition of a run. `image` is the firmware, None for scripted robots; `brain` is its name for `--brain`."""

    scene: Scene
    brain: str
    controller: str
    image: Path | None
    trials: int
    seconds: float
    seed: int
    experiment: Path | None = None
    """File of a user's experiment; None for a built-in or installed one."""
    images: tuple[tuple[str, Path | None], ...] = ()
    """Firmware by the name that groups have for it in the scene; None for a scripted group."""
    controllers: tuple[tuple[str, Path], ...] = ()
    """Python files of controllers, by the name that the scene or the run has for them."""

    @property
    def loaded_experiment(self) -> Experiment:
        """The experiment of the run: its metrics and its supervisor. Raises SceneError."""
        return experiment_of(str(self.experiment) if self.experiment is not None else self.scene.experiment)

    @property
    def has_firmware(self) -> bool:
        """Whether any robot runs firmware. All robots of the trial then run in the shorter quantum."""
        return any(self.image_of(one) is not None for one in self.scene.groups or (RobotGroup(),))

    def own_controller_of(self, group: RobotGroup) -> Path | None:
        """Return the Python file that controls a group; None for firmware and for the tables A and B."""
        return None if group.image else dict(self.controllers).get(group.controller or self.controller)

    def image_of(self, group: RobotGroup) -> Path | None:
        """Return the firmware of a group; None if it is scripted."""
        if group.image:
            return dict(self.images)[group.image]
        return self.image if self.own_controller_of(group) is None else None

    def key(self) -> dict[str, Any]:
        """Return everything that a trial depends on except its seed; it is stored in every file."""
        scene = _without_nan(json.loads(json.dumps(asdict(self.scene))))
        own = {name: _digest(path) for name, path in self.controllers}
        return ({"controllers_sha256": own} if own else {}) | {
            "scene": scene,
            "brain": self.brain,
            "controller": self.controller,
            "image_sha256": _digest(self.image),
            "experiment_sha256": _digest(self.experiment),
            "images_sha256": {name: _digest(path) for name, path in self.images},
            "seconds": self.seconds,
            "versions": versions(),
        }


def _without_nan(value: Any) -> Any:
    """Replace nan by None in a JSON value, so that equal values compare equal."""
    if isinstance(value, dict):
        return {key: _without_nan(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_without_nan(one) for one in value]
    return None if value != value else value


def _digest(path: Path | None) -> str | None:
    """Return the SHA-256 of a file; None without a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path is not None else None


@dataclass(frozen=True)
class FinishedTrial:
    """A finished trial: its number, the host time in s, and the faults as (robot, simulated seconds, cause)."""

    trial: int
    host_s: float
    faults: list[tuple[int, float, str]]


def trial_path(folder: Path, number: int) -> Path:
    """Return the path of trial `number`, counted from 1."""
    return folder / f"trial-{number:04d}.parquet"


def make_controllers(plan: Plan, seed: int, robots: Sequence[int], channel: OpticalChannel | None) -> list[Controller]:
    """Return the controllers of some robots, made by the engine of each kind. Raises emu.LoadError for an unusable
    image."""
    made: dict[int, Controller] = {}
    for kind in dict.fromkeys(map(plan.scene.robot_kind, robots)):
        mine = [robot for robot in robots if plan.scene.robot_kind(robot) is kind]
        programs = [_program(plan, robot) for robot in mine]
        made |= zip(mine, kind.controllers(plan.scene, seed, mine, programs, channel), strict=True)
    return [made[robot] for robot in robots]


def _program(plan: Plan, robot: int) -> Program:
    """Return what a robot runs, by the firmware and controller of its group."""
    group = plan.scene.group_of(robot)
    return Program(group.controller or plan.controller, plan.image_of(group), plan.own_controller_of(group))


@contextmanager
def controllers_of(plan: Plan, seed: int) -> Iterator[tuple[list[Controller], OpticalChannel | None]]:
    """Yield the controllers of one trial and the optical channel they share; close the controllers at the end."""
    channel = OpticalChannel.of(plan.scene) if plan.has_firmware else None
    controllers: list[Controller] = []
    try:
        controllers += make_controllers(plan, seed, range(plan.scene.robots.count), channel)
        yield controllers, channel
    finally:
        for controller in controllers:
            controller.close()


def run_one(
    plan: Plan, number: int, folder: Path, report: Report | None = None,
    on_start: Callable[[World, Sequence[Controller]], None] | None = None, threads: int = 1,
) -> FinishedTrial:  # fmt: skip
    """Run trial `number` (from 1) with `threads` threads for its robots, and write its file.

    `on_start` is called before the first quantum, with the world and the controllers.

    Raises SceneError, RecordError, emu.LoadError."""
    start = time.perf_counter()
    seed = plan.seed + number - 1
    about = plan.key() | {"seed": seed, "faults": []}
    if plan.experiment is not None:
        about["experiment"] = declaration_of(plan.loaded_experiment)
    live = LiveFile(live_path(folder, number), about) if plan.has_firmware else None
    try:
        progress = None if report is None else (lambda seconds: report(number, seconds))
        on_row = live.write if live is not None else None
        with controllers_of(plan, seed) as (controllers, channel):
            world = World(plan.scene, seed)
            if on_start is not None:
                on_start(world, controllers)
            result = run_trial(plan.scene, seed, controllers, plan.seconds, progress, world, on_row, channel,
                               plan.loaded_experiment, threads)  # fmt: skip
        about["faults"] = [list(fault) for fault in result.faults]
        if plan.experiment is not None:
            _add_curves(result.rows, plan.loaded_experiment, about)
        write_trial(trial_path(folder, number), result.rows, about)
    finally:
        if live is not None:
            live.close()
    return FinishedTrial(number, time.perf_counter() - start, result.faults)


def _add_curves(rows: Rows, experiment: Experiment, about: dict[str, Any]) -> None:
    """Add the curves of a user's experiment as columns: commands then show the record without the experiment's code."""
    with suppress(SceneError):  # failing metrics must not lose the trial; the command reports them afterwards
        series = experiment.series(Trial(Path("trial"), rows.columns, about).samples)
        rows.columns.update({CURVE_COLUMN + name: values.tolist() for name, values in series.curves.items()})


@contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Lock the folder of a run, which is created if missing. The system releases the lock of a killed process.

    Raises FolderInUseError if another run holds the lock, RecordError if the folder cannot be created."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with FileLock(folder / ".lock", timeout=0):
            yield
    except Timeout:
        raise FolderInUseError(f"{folder}: another run is writing here; wait for it or choose another --out") from None
    except FileExistsError:
        raise RecordError(f"{folder}: is not a folder") from None


def open_folder(plan: Plan, folder: Path, arguments: list[str]) -> list[int]:
    """Start or continue a run in a locked folder; return the numbers of the missing trials.

    The manifest stores the command's `arguments`. Raises RecordError if the folder holds another run.
    """
    before = check_folder(plan, folder)
    key = plan.key() | {"seed": plan.seed}
    write_manifest(folder, (before or {"host": []}) | {"key": key, "made_on": host(), "command": ["arena", *arguments]})
    return [number for number in range(1, plan.trials + 1) if not trial_path(folder, number).exists()]


def check_folder(plan: Plan, folder: Path) -> dict[str, Any] | None:
    """Return the manifest in the folder of a run, None without one. Raises RecordError if it is that of another run."""
    if not (folder / MANIFEST).exists():
        return None
    before, key = read_manifest(folder), plan.key() | {"seed": plan.seed}
    if before["key"] != key:
        raise RecordError(f"{folder}: holds another run (different {', '.join(_differing_parts(before['key'], key))}); "
                          "choose another --out")  # fmt: skip
    return before


def _differing_parts(before: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """Return names of the parts in which two keys differ."""
    different = [name for name in now if name != "versions" and before.get(name) != now[name]]
    old, new = before["versions"], now["versions"]
    return different + [f"version of {name}" for name in new if old.get(name) != new[name]]


def run_all(
    plan: Plan,
    folder: Path,
    numbers: list[int],
    jobs: int,
    report: Report,
    on_finished: Callable[[FinishedTrial], None],
) -> None:
    """Run trials `numbers` on `jobs` worker processes; with 1 job, in this process.

    If there are fewer trials than jobs, each trial gets several threads. Raises the exception of a failed trial; files
    of finished trials are kept."""
    threads = max(jobs // max(len(numbers), 1), 1)
    if jobs <= 1 or len(numbers) <= 1:
        for number in numbers:
            on_finished(run_one(plan, number, folder, report, threads=threads))
        return
    context = multiprocessing.get_context("spawn")
    queue: Any = context.Queue()
    with ProcessPoolExecutor(min(jobs, len(numbers)), context, _init_worker, (queue,)) as pool:
        pending = {pool.submit(_run_in_worker, plan, number, folder, threads) for number in numbers}
        try:
            while pending:
                finished, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
                while not queue.empty():
                    report(*queue.get())
                for future in finished:
                    on_finished(future.result())
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _init_worker(queue: Any) -> None:
    """Prepare a worker process: store the queue of progress reports, and watch the parent process."""
    global _queue
    _queue = queue
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this worker when its parent process has ended, even in the middle of a trial."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run_in_worker(plan: Plan, number: int, folder: Path, threads: int) -> FinishedTrial:
    """Run one trial in a worker process and report progress through the queue."""
    return run_one(plan, number, folder, lambda trial, seconds: _queue.put((trial, seconds)), threads=threads)
