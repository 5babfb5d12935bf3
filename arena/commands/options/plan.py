"""The options that define the trials of a plan, and the plan they define."""

from __future__ import annotations

import argparse
import math
import re
import tomllib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from arena.campaign.campaign import Plan
from arena.commands.options.arguments import count_or_none, duration
from arena.experiments import experiment_file
from arena.robots.epuck import SELECTOR
from arena.robots.images import image_for
from arena.robots.reactive import SPEED_TABLES
from arena.scene.limits import FIRMWARE_ROBOTS
from arena.scene.loader import Scene, SceneError, load_scene, scripted
from arena.scene.robot_kind import EPUCK, KILOBOT
from arena.scene.schema import RobotGroup
from arena.trial.record import EXPERIMENT, RecordError, read_trial, write_bytes
from emu.host.paths import use_cache

DEFAULT_BRAIN, SCRIPTED, DEFAULT_CONTROLLER = "openswarm", "scripted", "A"


def add_plan(command: argparse.ArgumentParser) -> None:
    """Add the options that define a trial."""
    command.add_argument("scene", metavar="SCENE", help="name of a scene (see `arena scenes`) or TOML file")
    command.add_argument(
        "--brain",
        help="openswarm (default), bare, scripted, or an ELF or HEX file: controls the groups of robots without an "
        "`image` or a controller in Python in the scene, or all robots if every group has one",
    )
    command.add_argument(
        "--controller",
        metavar="NAME",
        help="table of speeds A (default), B or aggregate (scripted only), or a Python file or entry point with a "
        "controller (docs/scenes.md)",
    )
    command.add_argument(
        "--minutes", type=duration, default=15.0, metavar="M", help="simulated minutes per trial (default 15)"
    )
    command.add_argument("--robots", type=count_or_none, metavar="N", help="number of robots, instead of the scene's")
    command.add_argument("--objects", type=count_or_none, metavar="N", help="number of objects, instead of the scene's")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.KEY=VALUE",
        help="change a value of the scene; repeatable",
    )
    command.add_argument(
        "--seed",
        type=count_or_none,
        default=1,
        help="seed of the first trial; each next trial has the next seed (default 1)",
    )
    command.add_argument(
        "--start",
        type=Path,
        metavar="RECORD",
        help="begin where the robots and objects of a recorded trial ended (trial-NNNN.parquet); firmware restarts",
    )
    command.add_argument(
        "--cache", type=use_cache, metavar="DIR", help="folder of the cache for firmware and native code"
    )


def with_overrides(scene: Scene, settings: list[str], robots: int | None = None, objects: int | None = None) -> Scene:
    """Return a scene with values from the command line. Raises SceneError, ValueError."""
    values: dict[str, Any] = {}
    for setting in settings:
        place, equals, text = setting.partition("=")
        if not equals or place.count(".") != 1:
            raise ValueError(f"--set {setting!r}: expected SECTION.KEY=VALUE, for example camera.range_cm=200")
        values[place.strip().replace(".", "__")] = parse_value(text.strip())
    if robots is not None:
        values["robots__count"] = robots
    if objects is not None:
        values["objects__count"] = objects
    return scene.with_values(**values)


def start_at_end_of(scene: Scene, record: Path) -> Scene:
    """Return a scene whose robots and objects begin at their poses in the last sample of a record.

    Raises RecordError for an unusable record, SceneError if the scene has other numbers of robots or objects."""
    trial = read_trial(record)
    if not len(trial.times):
        raise RecordError(f"{record}: has no samples, so no poses to start from")
    turned = [trial.columns[f"r{robot}_heading"][-1] for robot in range(trial.scene.robots.count)]
    robots = [(*place, _degrees(rad)) for place, rad in zip(trial.robots[-1].tolist(), turned, strict=True)]
    objects = [(*pose[:2], *map(_degrees, pose[2:])) for pose in trial.object_poses[-1]]
    try:
        return scene.with_values(start__robot_poses=robots, start__object_poses=objects)
    except SceneError as error:
        raise SceneError(f"--start {record}: {error}") from None


def _degrees(heading: float) -> float:
    """Return a heading in degrees, -180 to 180. Headings of a record count full turns."""
    return math.degrees(math.remainder(heading, math.tau))


def parse_value(text: str) -> bool | int | float | str | list[Any]:
    """Parse `text` as a truth value, a number or a list as in a scene; return other text, and `inf`, unchanged."""
    if text in ("true", "false"):
        return text == "true"
    if text.startswith("["):
        with suppress(ValueError, RecursionError):
            return list(tomllib.loads(f"value = {text}")["value"])
    for kind in (int, float):
        try:
            return kind(text) if text != "inf" else text
        except ValueError:
            continue
    return text


def folder_name(text: str) -> str:
    """Return `text` as part of a folder's name, without characters that are special to a file system."""
    return re.sub("[^A-Za-z0-9.,=+_-]+", "-", text.lower()).strip("-.")


def check_firmware(plan: Plan) -> None:
    """Raise SceneError if more robots run firmware than one process can hold."""
    count = sum(plan.image_of(plan.scene.group_of(robot)) is not None for robot in range(plan.scene.robots.count))
    if count > FIRMWARE_ROBOTS:
        raise SceneError(f"{plan.scene.name}: robots.count: {count} robots run firmware; expected at most "
                         f"{FIRMWARE_ROBOTS}, or --brain scripted")  # fmt: skip


def plan_from(options: argparse.Namespace, trials: int) -> Plan:
    """Return the plan that the options of `add_plan` define. Raises SceneError, RecordError, LoadError, ValueError."""
    scene = with_overrides(load_scene(options.scene), options.set, options.robots, options.objects)
    if options.start is not None:
        scene = start_at_end_of(scene, options.start)
    home = Path(options.scene).parent
    if options.brain is not None and all(group.image for group in scene.groups):
        scene = replace(scene, groups=tuple(replace(group, image="") for group in scene.groups))
    if options.brain not in (None, SCRIPTED) and all(group.controller not in ("", *SELECTOR) for group in scene.groups):
        scene = replace(scene, groups=tuple(replace(group, controller="") for group in scene.groups))
    kinds: dict[str, str] = {}
    for group in scene.groups:
        if group.image and kinds.setdefault(group.image, group.kind) != group.kind:
            raise SceneError(f"{scene.name}: robots.image: groups of different kinds have the image {group.image!r}; "
                             "name their files")  # fmt: skip
    own_images = list(kinds)
    images = tuple((one, image_for(one, home, kind)) for one, kind in kinds.items())
    bare = {group.kind for group in scene.groups if not group.image}
    if len(bare) > 1 and options.brain not in (None, SCRIPTED):
        raise SceneError(f"{scene.name}: --brain {options.brain} cannot run on robots of two kinds; name an `image` in "
                         "the [[robots]] tables of one kind")  # fmt: skip
    if KILOBOT.name in bare and (options.brain is None or len(bare) > 1):
        raise SceneError(f"{scene.name}: robots.image: a Kilobot runs the image of a firmware; none is named")
    if scene.groups and all(group.image for group in scene.groups):
        brain, image = "+".join(dict.fromkeys(Path(one).stem for one in own_images)), None
    else:
        is_python = all((one.controller or options.controller) not in (None, "", *SELECTOR)
                        for one in scene.groups or (RobotGroup(),) if not one.image)  # fmt: skip
        name = options.brain or (SCRIPTED if is_python else DEFAULT_BRAIN)
        brain, image = Path(name).stem, image_for(name, kind=KILOBOT.name if KILOBOT.name in bare else EPUCK.name)
    own, (controller, controllers) = experiment_file(scene.experiment, home), _controllers(scene, options, home)
    if controller not in SELECTOR and image is not None:
        raise ValueError(f"--controller {options.controller} runs in Python: use it without --brain {options.brain}")
    plan = Plan(scene, brain, controller, image, trials, 60 * options.minutes, options.seed, own, images, controllers)
    check_firmware(plan)
    unused = "clock.scripted_quantum_ms" if plan.has_firmware else "clock.quantum_ms"
    if any(setting.partition("=")[0].strip() == unused for setting in options.set):
        raise ValueError(f"--set {unused} has no effect: {'some' if plan.has_firmware else 'no'} robot runs firmware")
    if options.controller is not None and not has_choice_of_controller(plan):
        raise ValueError(f"--controller {options.controller} has no effect in scene {scene.name}: every robot has its "
                         "own; change `controller` or `selector` in [[robots]], or `selector` in [start]"
                         + ("" if controller in SELECTOR else "; or add --brain scripted"))  # fmt: skip
    return plan if plan.has_firmware else replace(plan, scene=scripted(scene))


def _controllers(scene: Scene, options: argparse.Namespace, home: Path) -> tuple[str, tuple[tuple[str, Path], ...]]:
    """Return the name of the run's controller, and the files of all controllers in Python by name.

    Paths in the scene are relative to `home`, that of the option to the working directory. Records name the option's
    file without its folder. Raises SceneError, ValueError."""
    wanted = [(group.controller, group.controller, home) for group in scene.groups]
    chosen = options.controller or DEFAULT_CONTROLLER
    wanted.append((Path(chosen).name, chosen, Path()))
    found: dict[str, Path] = {}
    for name, file, folder in wanted:
        if file in ("", *SPEED_TABLES):
            continue
        from arena.robots.user_controller import controller_file  # imported here: it loads the emulator's sensors

        path = controller_file(file, folder)
        if found.setdefault(name, path) != path:
            raise ValueError(f"--controller {file}: the scene has another file of this name; rename one of them")
    return Path(chosen).name, tuple(found.items())


def has_choice_of_controller(plan: Plan) -> bool:
    """Whether the controller of the run determines the speeds or the selector of any robot."""
    for group in plan.scene.groups or (RobotGroup(),):
        if group.kind == KILOBOT.name:
            continue
        image = plan.image_of(group)
        selector = plan.scene.start.selector if group.selector < 0 else group.selector
        if not group.controller and (image is None or (selector < 0 and plan.controller in SELECTOR)):
            return True
    return False


def copy_inputs(plan: Plan, folder: Path) -> Plan:
    """Copy firmware, experiment and controllers of a plan into the folder; return the plan of the copies.

    The originals may be rebuilt while the trials run."""
    if plan.experiment is not None:
        write_bytes(folder / EXPERIMENT, plan.experiment.read_bytes())
        plan = replace(plan, experiment=folder / EXPERIMENT)
    images = []
    for place, (group, path) in enumerate((("", plan.image), *plan.images)):
        copy = folder / f"firmware{f'-{place}' if place else ''}{path.suffix}" if path is not None else None
        if copy is not None and path is not None:
            write_bytes(copy, path.read_bytes())
        images.append((group, copy))
    controllers = []
    for place, (name, path) in enumerate(plan.controllers, start=1):
        controllers.append((name, folder / f"controller-{place}.py"))
        write_bytes(controllers[-1][1], path.read_bytes())
    return replace(plan, image=images[0][1], images=tuple(images[1:]), controllers=tuple(controllers))
