"""`arena run SCENE`: trials of one brain and controller into a folder."""

from __future__ import annotations

import argparse
import os
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from arena.campaign.campaign import Done, Plan, claimed, open_folder, run_all
from arena.commands.arguments import count, count_or_none, duration
from arena.commands.progress import Told
from arena.experiments import experiment_file
from arena.robots.images import image_for
from arena.robots.reactive import CONTROLLERS
from arena.scene.loader import Scene, load_scene, scripted
from arena.trial.json_numbers import json_text
from arena.trial.manifest import note_host_time
from arena.trial.record import EXPERIMENT, Trial, trials_in, write_bytes
from emu.host.paths import use_cache

EXAMPLE = "example: arena run clustering --brain openswarm --controller A --trials 10 --jobs 2 --out results/os-A"


def parser() -> argparse.ArgumentParser:
    """Options of the command."""
    made = argparse.ArgumentParser(description="run trials; finished ones are kept and skipped", epilog=EXAMPLE)
    made.add_argument("--trials", type=count, default=10, metavar="N")
    add_plan(made)
    made.add_argument(
        "--jobs",
        type=count,
        default=os.cpu_count() or 1,
        metavar="N",
        help="cores to use (default all): trials at a time, threads of one where there are fewer trials",
    )
    made.add_argument(
        "--processes",
        type=count,
        default=1,
        metavar="N",
        help="run one trial after the other, its robots in N processes (default 1): see arena/README.md",
    )
    made.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on a Dask cluster instead, for example tcp://host:8786"
    )
    made.add_argument("--out", type=Path, metavar="FOLDER", help="default results/SCENE-BRAIN-CONTROLLER")
    made.add_argument("--json", action="store_true", help="results as JSON on standard output")
    return made


def add_plan(made: argparse.ArgumentParser) -> None:
    """Options that say what a trial is."""
    made.add_argument("scene", metavar="SCENE", help="name (arena scenes) or TOML file")
    made.add_argument("--brain", default="openswarm", help="openswarm (default), bare, scripted, or an ELF or HEX file")
    made.add_argument("--controller", default="A", choices=sorted(CONTROLLERS), help="table of speeds (default A)")
    made.add_argument("--minutes", type=duration, default=15.0, metavar="M", help="simulated, per trial (default 15)")
    made.add_argument("--robots", type=count_or_none, metavar="N", help="instead of the scene's number")
    made.add_argument("--objects", type=count_or_none, metavar="N", help="instead of the scene's number")
    made.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE", help="change a scene value")
    made.add_argument("--seed", type=count_or_none, default=1, help="of the first trial, then counted on (default 1)")
    made.add_argument("--cache", type=use_cache, metavar="DIR", help="keep images and native code there")


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


def folder_name(text: str) -> str:
    """A text as part of a folder's name: no letter that means something to a file system."""
    return re.sub("[^A-Za-z0-9.,=+_-]+", "-", text.lower()).strip("-.")


def planned(options: argparse.Namespace, trials: int) -> Plan:
    """What the options of `add_plan` ask for. Raises SceneError, LoadError, ValueError."""
    scene = changed(load_scene(options.scene), options.set, options.robots, options.objects)
    home = Path(options.scene).parent
    image = image_for(options.brain) if not scene.groups or any(not one.image for one in scene.groups) else None
    images = tuple((one, image_for(one, home)) for one in dict.fromkeys(group.image for group in scene.groups) if one)
    name = Path(options.brain).stem
    own = experiment_file(scene.experiment, home)
    plan = Plan(scene, name, options.controller, image, trials, 60 * options.minutes, options.seed, own, images)
    return plan if plan.has_firmware else replace(plan, scene=scripted(scene))


def kept(plan: Plan, folder: Path) -> Plan:
    """The plan with everything it needs in the folder: what it came from may be built anew meanwhile."""
    if plan.experiment is not None:
        write_bytes(folder / EXPERIMENT, plan.experiment.read_bytes())
        plan = replace(plan, experiment=folder / EXPERIMENT)
    images = []
    for place, (group, path) in enumerate((("", plan.image), *plan.images)):
        copy = folder / f"firmware{f'-{place}' if place else ''}{path.suffix}" if path is not None else None
        if copy is not None and path is not None:
            write_bytes(copy, path.read_bytes())
        images.append((group, copy))
    return replace(plan, image=images[0][1], images=tuple(images[1:]))


def run(options: argparse.Namespace) -> int:
    """Exit status 1 if something happened to a robot. Raises SceneError, RecordError, LoadError, ValueError."""
    made = carried_out(options)
    if options.json:
        print(json_text({"folder": str(made.folder), "trials": list(map(summary, made.trials)), "new": made.new}))
    else:
        say(made)
    return 1 if made.faults else 0


class Made(NamedTuple):
    """What a run has left: all its trials, of which so many are new, and whether something happened to a robot."""

    folder: Path
    trials: list[Trial]
    new: int
    faults: bool


def say(made: Made) -> None:
    """A line per trial, and how many there are."""
    print("\n".join(map(told, made.trials)))
    print(f"{len(made.trials)} trials in {made.folder}")


def carried_out(options: argparse.Namespace) -> Made:
    """Run what is missing. Raises as `run`."""
    plan = planned(options, options.trials)
    folder = options.out or Path("results") / f"{plan.scene.name}-{plan.brain}-{options.controller}"
    with claimed(folder):
        missing = open_folder(plan, folder, sys.argv[1:])
        plan = kept(plan, folder)
        faults = with_progress(plan, folder, missing, options.jobs, options.scheduler, options.processes)
    wanted = {f"trial-{number:04d}.parquet" for number in range(1, options.trials + 1)}
    trials = [trial for trial in trials_in(folder) if trial.path.name in wanted]
    return Made(folder, trials, len(missing), bool(faults))


def summary(trial: Trial) -> dict[str, Any]:
    """The numbers of one trial at its end: every curve's last value and every measure."""
    done, end = trial.course, float(trial.times[-1])
    curves = {one.name: done.last(one.name) for one in trial.experiment.curves}
    measures = {one.name: one.of(done, end) for one in trial.experiment.measures}
    about = {"trial": trial.path.stem, "seed": trial.about["seed"], "seconds": end, "faults": trial.about["faults"]}
    return curves | measures | about


def told(trial: Trial) -> str:
    """The same in words."""
    done, curves = trial.course, trial.experiment.curves
    values = ", ".join(f"{one.label} {one.shown(done.last(one.name))}" for one in curves)
    return f"{trial.path.stem}: seed {trial.about['seed']}, after {trial.times[-1]:g} s: {values}"


def with_progress(
    plan: Plan, folder: Path, missing: list[int], jobs: int, scheduler: str | None = None, processes: int = 1
) -> bool:
    """Run what is missing, on workers here or on those of a Dask scheduler; true if something happened to a robot."""
    stopped = False
    with Told(len(missing), plan.seconds) as telling:

        def done(one: Done) -> None:
            nonlocal stopped
            telling.finished(one.trial, one.host_s)
            note_host_time(folder, one.trial, one.host_s, one.faults)
            for robot, seconds, why in one.faults:
                stopped = True
                telling.line(f"trial {one.trial}, {seconds:.1f} s: robot {robot} {why}")

        if scheduler is not None and missing:
            from arena.campaign.cluster import run_on

            run_on(scheduler, plan, folder, missing, telling.reached, done)
        else:
            run_all(plan, folder, missing, jobs, telling.reached, done, processes)
    return stopped
