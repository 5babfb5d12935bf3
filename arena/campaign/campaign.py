"""Many trials: which are missing, on how many workers, with what progress. What enters: a `Plan`; what leaves: files.

A trial is the unit of work: it depends on its plan and seed alone, so the number of workers cannot show in a file. A
finished trial is kept; one that was interrupted starts again from its seed (experiment.md §3).
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from threading import Thread
from typing import Any

from filelock import FileLock, Timeout

from arena.experiments import Experiment, experiment_of
from arena.infrared.channel import Ether
from arena.lockstep.processes import Crew
from arena.replay.live_feed import LiveFile, live_path
from arena.robots.controller import Brain, ScriptedBrain
from arena.scene.loader import Scene
from arena.trial.manifest import MANIFEST, read_manifest, write_manifest
from arena.trial.record import FolderInUseError, RecordError, write_trial
from arena.trial.trial import run_trial
from arena.trial.versions import host, versions
from arena.world.physics import World

Report = Callable[[int, float], None]
"""report(trial, seconds simulated)."""
_queue: Any = None

SELECTOR = {"A": 0, "B": 1}
"""Position of the robots' switch for a controller: bit 0 chooses B; bit 3 would start the project's own firmware
without the remote control (firmware/apps/clustering)."""


@dataclass(frozen=True)
class Plan:
    """What a run is. `image` is the firmware, None for scripted brains; `brain` its name for people."""

    scene: Scene
    brain: str
    controller: str
    image: Path | None
    trials: int
    seconds: float
    seed: int
    experiment: Path | None = None
    """The experiment's file, if it is one's own."""
    images: tuple[tuple[str, Path | None], ...] = ()
    """Brains of groups that have their own, by the name the scene has for them."""

    @property
    def to_do(self) -> Experiment:
        """What is measured, and who supervises. Raises SceneError."""
        return experiment_of(str(self.experiment) if self.experiment is not None else self.scene.experiment)

    @property
    def has_firmware(self) -> bool:
        """Whether any robot is emulated: all of a trial's robots then live in its shorter quantum."""
        own = dict(self.images)
        groups = self.scene.groups or (self.scene.group_of(0),)
        return any((own[one.image] if one.image else self.image) is not None for one in groups)

    def key(self) -> dict[str, Any]:
        """What a trial depends on beside its seed: recorded in every file."""
        scene = _plain(json.loads(json.dumps(asdict(self.scene))))
        return {
            "scene": scene,
            "brain": self.brain,
            "controller": self.controller,
            "image_sha256": _digest(self.image),
            "experiment_sha256": _digest(self.experiment),
            "images_sha256": {name: _digest(path) for name, path in self.images},
            "seconds": self.seconds,
            "versions": versions(),
        }


def _plain(value: Any) -> Any:
    """JSON without nan, which is not equal to itself."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return None if value != value else value


def _digest(path: Path | None) -> str | None:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path is not None else None


@dataclass(frozen=True)
class Done:
    """A trial that is finished: host seconds it took, faults as (robot, seconds, why)."""

    trial: int
    host_s: float
    faults: list[tuple[int, float, str]]


def trial_path(folder: Path, number: int) -> Path:
    """File of a trial, counted from 1."""
    return folder / f"trial-{number:04d}.parquet"


def make_brains(plan: Plan, seed: int, robots: Sequence[int], ether: Ether | None) -> list[Brain]:
    """Brains of some robots. Raises emu.LoadError for an unusable image."""
    own = dict(plan.images)
    return [_brain(plan, own, seed, robot, ether) for robot in robots]


def _brain(plan: Plan, own: dict[str, Path | None], seed: int, robot: int, ether: Ether | None) -> Brain:
    group = plan.scene.group_of(robot)
    image = own[group.image] if group.image else plan.image
    controller = group.controller or plan.controller
    if image is None:
        return ScriptedBrain(plan.scene, seed, robot, controller)
    from arena.robots.firmware_controller import EmulatedBrain  # the emulator is loaded by those who need it

    chosen = plan.scene.start_of(robot).selector
    return EmulatedBrain(plan.scene, seed, robot, image, SELECTOR[controller] if chosen < 0 else chosen, ether)


@contextmanager
def brains_of(plan: Plan, seed: int, processes: int) -> Iterator[tuple[list[Brain], list[Crew], Ether | None]]:
    """All brains of a trial, spread over some processes, closed at the end. This one has the fewest robots, because it
    has the world."""
    count = plan.scene.robots.count
    ether = Ether.of(plan.scene) if plan.has_firmware else None
    bounds = [count * part // processes for part in range(processes + 1)]
    parts = [range(one, other) for one, other in pairwise(bounds) if other > one]
    brains: list[Brain] = []
    crews: list[Crew] = []
    try:
        for part in parts[1:]:
            crews.append(Crew(partial(make_brains, plan, seed), part, ether, len(parts)))
        brains += make_brains(plan, seed, parts[0], ether) if parts else []
        for crew in crews:
            brains += crew.brains
        yield brains, crews, ether
    finally:
        for brain in brains:
            brain.close()
        for crew in crews:
            crew.close()


def run_one(
    plan: Plan, number: int, folder: Path, report: Report | None = None, processes: int = 1,
    meet: Callable[[World, Sequence[Brain]], None] | None = None, threads: int = 1,
) -> Done:  # fmt: skip
    """Run trial `number` (from 1), its robots in `processes` or run by `threads` of this one, and write its file.
    `meet` is shown world and robots first.

    Raises SceneError, RecordError, emu.LoadError."""
    start = time.perf_counter()
    seed = plan.seed + number - 1
    about = plan.key() | {"seed": seed, "faults": []}
    live = LiveFile(live_path(folder, number), about) if plan.has_firmware else None
    try:
        progress = None if report is None else (lambda seconds: report(number, seconds))
        on_row = live.write if live is not None else None
        with brains_of(plan, seed, processes) as (brains, crews, ether):
            world = World(plan.scene, seed)
            if meet is not None:
                meet(world, brains)
            result = run_trial(plan.scene, seed, brains, plan.seconds, progress, world, on_row, crews, ether,
                               plan.to_do, threads)  # fmt: skip
        about["faults"] = [list(fault) for fault in result.faults]
        write_trial(trial_path(folder, number), result.rows, about)
    finally:
        if live is not None:
            live.close()
    return Done(number, time.perf_counter() - start, result.faults)


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """A run's folder, for one run at a time; the system gives it free when a run is killed.

    Raises FolderInUseError if another run has it, RecordError if it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with FileLock(folder / ".lock", timeout=0):
            yield
    except Timeout:
        raise FolderInUseError(f"{folder}: another run is writing here; wait for it or choose another --out") from None
    except FileExistsError:
        raise RecordError(f"{folder}: is not a folder") from None


def open_folder(plan: Plan, folder: Path, arguments: list[str]) -> list[int]:
    """Begin or continue the run in a folder that is `claimed`; numbers of the trials still to do. The manifest
    keeps the command's `arguments`.

    Raises RecordError if it holds another run.
    """
    key = plan.key() | {"seed": plan.seed}
    before = read_manifest(folder) if (folder / MANIFEST).exists() else None
    if before is not None and before["key"] != key:
        raise RecordError(f"{folder}: holds another run (different {', '.join(_changed(before['key'], key))}); "
                          "choose another --out")  # fmt: skip
    write_manifest(folder, (before or {"host": []}) | {"key": key, "made_on": host(), "command": ["arena", *arguments]})
    return [number for number in range(1, plan.trials + 1) if not trial_path(folder, number).exists()]


def _changed(before: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """Which parts of two keys differ, in the words of people."""
    changed = [name for name in now if name != "versions" and before.get(name) != now[name]]
    old, new = before["versions"], now["versions"]
    return changed + [f"version of {name}" for name in new if old.get(name) != new[name]]


def run_all(
    plan: Plan, folder: Path, numbers: list[int], jobs: int, report: Report, done: Callable[[Done], None],
    processes: int = 1,
) -> None:  # fmt: skip
    """Run trials `numbers` on `jobs` workers; 1 = in this process. Where there are fewer trials than that, each gets
    some threads. With several `processes` trials are run one after the other, their emulated robots spread over them.
    Raises what a trial raises, after the others of its moment; files of finished trials stay."""
    threads = max(jobs // max(len(numbers), 1), 1)
    if jobs <= 1 or len(numbers) <= 1 or processes > 1:
        for number in numbers:
            done(run_one(plan, number, folder, report, processes if plan.has_firmware else 1, threads=threads))
        return
    context = multiprocessing.get_context("spawn")
    queue: Any = context.Queue()
    with ProcessPoolExecutor(min(jobs, len(numbers)), context, _begin, (queue,)) as pool:
        pending = {pool.submit(_work, plan, number, folder, threads) for number in numbers}
        try:
            while pending:
                finished, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
                while not queue.empty():
                    report(*queue.get())
                for future in finished:
                    done(future.result())
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _begin(queue: Any) -> None:
    global _queue
    _queue = queue
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A trial can take minutes: end it when the process that wanted it has been killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _work(plan: Plan, number: int, folder: Path, threads: int) -> Done:
    return run_one(plan, number, folder, lambda trial, seconds: _queue.put((trial, seconds)), threads=threads)
