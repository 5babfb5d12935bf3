"""`arena run SCENE`: trials of one brain and controller into a folder."""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from arena.campaign import Done, Plan, note_host_time, open_folder, run_all
from arena.controllers import CONTROLLERS
from arena.firmware import image_for
from arena.metrics import time_to
from arena.record import Trial, trials_in, write_bytes
from arena.scene import Scene, load_scene, scripted

EXAMPLE = "example: arena run clustering --brain openswarm --controller A --trials 10 --jobs 2 --out results/os-A"


def parser() -> argparse.ArgumentParser:
    """Options of the command."""
    made = argparse.ArgumentParser(description="run trials; finished ones are kept and skipped", epilog=EXAMPLE)
    made.add_argument("scene", metavar="SCENE", help="name (arena scenes) or TOML file")
    made.add_argument("--brain", default="openswarm", help="openswarm (default), bare, scripted, or an ELF or HEX file")
    made.add_argument("--controller", default="A", choices=sorted(CONTROLLERS), help="table of speeds (default A)")
    made.add_argument("--trials", type=int, default=10, metavar="N")
    made.add_argument("--minutes", type=float, default=15.0, metavar="M", help="simulated time of a trial (default 15)")
    made.add_argument("--robots", type=int, metavar="N", help="instead of the scene's number")
    made.add_argument("--objects", type=int, metavar="N", help="instead of the scene's number")
    made.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE", help="change a scene value")
    made.add_argument("--seed", type=int, default=1, help="of the first trial, then counted on (default 1)")
    made.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="worker processes")
    made.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on a Dask cluster instead, for example tcp://host:8786"
    )
    made.add_argument("--out", type=Path, metavar="FOLDER", help="default results/SCENE-BRAIN-CONTROLLER")
    made.add_argument("--json", action="store_true", help="results as JSON on standard output")
    return made


def changed(scene: Scene, settings: list[str], robots: int | None = None, objects: int | None = None) -> Scene:
    """A scene with command-line values. Raises SceneError, ValueError."""
    values: dict[str, Any] = {}
    for setting in settings:
        place, equals, text = setting.partition("=")
        if not equals or place.count(".") != 1:
            raise ValueError(f"--set {setting!r}: expected SECTION.KEY=VALUE, for example camera.range_cm=200")
        values[place.strip().replace(".", "__")] = parsed(text.strip())
    if robots is not None:
        values["robots__count"] = robots
    if objects is not None:
        values["objects__count"] = objects
    return scene.with_values(**values)


def parsed(text: str) -> bool | int | float | str:
    """A number or a truth value if it is one."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text) if text != "inf" else text
        except ValueError:
            continue
    return text


def run(options: argparse.Namespace) -> int:
    """Exit status 1 if a robot's firmware stopped. Raises SceneError, RecordError, LoadError, ValueError."""
    if options.trials < 1 or not options.minutes > 0:
        raise ValueError("--trials and --minutes must be positive")
    scene = changed(load_scene(options.scene), options.set, options.robots, options.objects)
    image = image_for(options.brain)
    if image is None:
        scene = scripted(scene)
    name = Path(options.brain).stem
    plan = Plan(scene, name, options.controller, image, options.trials, 60 * options.minutes, options.seed)
    folder = options.out or Path("results") / f"{scene.name}-{name}-{options.controller}"
    missing = open_folder(plan, folder, sys.argv)
    if image is not None:  # kept beside the results; the one it came from may be built anew meanwhile
        kept = folder / f"firmware{image.suffix}"
        write_bytes(kept, image.read_bytes())
        plan = replace(plan, image=kept)
    faults = with_progress(plan, folder, missing, options.jobs, options.scheduler)
    wanted = {f"trial-{number:04d}.parquet" for number in range(1, options.trials + 1)}
    results = [summary(trial) for trial in trials_in(folder) if trial.path.name in wanted]
    if options.json:
        print(json.dumps({"folder": str(folder), "trials": results, "new": len(missing)}))
    else:
        for one in results:
            print(f"{one['trial']}: seed {one['seed']}, largest cluster {one['share']:.0%} at {one['seconds']:g} s, "
                  f"compactness {one['compactness']:.0f}, 80 % after {one['t80']:.0f} s")  # fmt: skip
        print(f"{len(results)} trials in {folder}")
    return 1 if faults else 0


def summary(trial: Trial) -> dict[str, Any]:
    """The numbers of one trial at its end."""
    done = trial.course
    return {
        "trial": trial.path.stem,
        "seed": trial.about["seed"],
        "seconds": float(trial.times[-1]),
        "share": float(done.share[-1]),
        "share_12cm": float(done.share_12cm[-1]),
        "compactness": float(done.compactness[-1]),
        "area": done.area,
        "t50": time_to(done.times, done.share, 0.5),
        "t80": time_to(done.times, done.share, 0.8),
        "faults": trial.about["faults"],
    }


def with_progress(plan: Plan, folder: Path, missing: list[int], jobs: int, scheduler: str | None = None) -> bool:
    """Run what is missing, on workers here or on those of a Dask scheduler; true if a robot stopped."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"),
               TimeRemainingColumn())  # fmt: skip
    stopped = False
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as progress:
        whole = progress.add_task(f"{len(missing)} trials", total=max(len(missing) * plan.seconds, 1))
        bars: dict[int, TaskID] = {}
        reached: dict[int, float] = {}

        def report(number: int, seconds: float) -> None:
            if number not in bars:
                bars[number] = progress.add_task(f"  trial {number}", total=plan.seconds)
            reached[number] = max(seconds, reached.get(number, 0.0))
            progress.update(bars[number], completed=seconds)
            progress.update(whole, completed=sum(reached.values()))

        def done(one: Done) -> None:
            nonlocal stopped
            report(one.trial, plan.seconds)
            progress.remove_task(bars.pop(one.trial))
            note_host_time(folder, one)
            for robot, seconds, why in one.faults:
                stopped = True
                console.print(f"trial {one.trial}: robot {robot} stopped at {seconds:.1f} s: {why}", markup=False)

        if scheduler is not None and missing:
            from arena.cluster import run_on

            run_on(scheduler, plan, folder, missing, report, done)
        else:
            run_all(plan, folder, missing, jobs, report, done)
    return stopped
