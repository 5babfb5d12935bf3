"""`arena sensitivity SCENE`: one scene value after the other away from the registered one, with scripted brains
(experiment.md §5)."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np

from arena.analysis.comparison import courses
from arena.campaign.campaign import Plan, claimed, open_folder
from arena.commands.arguments import count, count_or_none, duration
from arena.commands.run import changed, folder_name, with_progress
from arena.experiments import experiment_file, experiment_of
from arena.robots.reactive import CONTROLLERS
from arena.scene.loader import load_scene, scripted
from arena.trial.json_numbers import json_text
from arena.trial.record import EXPERIMENT, trials_in, write_bytes, write_text

VARIANTS: Final = {
    "as registered": [],
    "4.33 frames/s (PO3030K)": ["camera.frame_tcy=3408000"],
    "18.4 frames/s": ["camera.frame_tcy=800000"],
    "range 100 cm": ["camera.range_cm=100"],
    "range unlimited": ["camera.range_cm=inf"],
    "thrust 1.5 N": ["robots.thrust_n=1.5"],
    "no slip (Enki's drive)": ["robots.thrust_n=inf"],
    "wheel noise 0": ["robots.wheel_noise=0"],
    "wheel noise 10 %": ["robots.wheel_noise=0.1"],
    "axle 53 mm": ["robots.axle_cm=5.3"],
    "floor friction 0.25": ["objects.floor_friction=0.25"],
    "floor friction 0.8": ["objects.floor_friction=0.8"],
    "mirrored picture": ["camera.mirrored=true"],
    "pitch -0.38 degrees": ["camera.pitch_deg=-0.38"],
    "pitch -3 degrees": ["camera.pitch_deg=-3"],
    "pitch +3 degrees": ["camera.pitch_deg=3"],
    "misses 10 % of frames": ["camera.false_negative=0.1"],
    "invents objects in 10 %": ["camera.false_positive=0.1"],
}
"""Ranges of docs/experiment.md §2. At -0.38 degrees, four rows, the window's second row shows robots to 135 cm."""


def parser() -> argparse.ArgumentParser:
    """Options of the command."""
    made = argparse.ArgumentParser(
        description="vary one value at a time with scripted brains and print the experiment's first metric",
        epilog="example: arena sensitivity clustering --trials 10 --minutes 10 --save results/sensitivity.md",
    )
    made.add_argument("scene", metavar="SCENE", help="name (arena scenes) or TOML file")
    made.add_argument("--controllers", default="AB", help="default AB")
    made.add_argument("--trials", type=count, default=10, metavar="N")
    made.add_argument("--minutes", type=duration, default=10.0, metavar="M")
    made.add_argument("--seed", type=count_or_none, default=1)
    made.add_argument("--only", action="append", metavar="TEXT", help="only variants whose name contains this")
    made.add_argument("--jobs", type=count, default=os.cpu_count() or 1, metavar="N")
    made.add_argument("--out", type=Path, default=Path("results/sensitivity"), metavar="FOLDER")
    made.add_argument("--save", type=Path, metavar="FILE", help="write the table as Markdown too")
    made.add_argument("--json", action="store_true")
    return made


def run(options: argparse.Namespace) -> int:
    """Raises SceneError, RecordError, ValueError."""
    if not options.controllers or set(options.controllers) - set(CONTROLLERS):
        raise ValueError(f"--controllers {options.controllers}: expected some of {''.join(CONTROLLERS)}")
    wanted = [name for name in VARIANTS if not options.only or any(text in name for text in options.only)]
    if not wanted:
        raise ValueError(f"--only {options.only}: no such variant; known: {'; '.join(VARIANTS)}")
    rows: list[dict[str, Any]] = []
    for name in wanted:
        row: dict[str, Any] = {"variant": name}
        for controller in options.controllers:
            row[controller] = _ends(options, name, controller)
        rows.append(row)
    text = _markdown(rows, options)
    if options.save is not None:
        write_text(options.save, text)
    print(json_text({"sensitivity": rows}) if options.json else text, end="" if not options.json else "\n")
    return 0


def _ends(options: argparse.Namespace, name: str, controller: str) -> list[float]:
    """The experiment's first metric at the end of each trial."""
    scene = scripted(changed(load_scene(options.scene), VARIANTS[name]))
    own = experiment_file(scene.experiment, Path(options.scene).parent)
    plan = Plan(scene, "scripted", controller, None, options.trials, 60 * options.minutes, options.seed, own)
    folder = options.out / f"{folder_name(name)}-{controller}"
    with claimed(folder):
        if own is not None:
            write_bytes(folder / EXPERIMENT, own.read_bytes())
        with_progress(plan, folder, open_folder(plan, folder, sys.argv[1:]), options.jobs)
    trials = [trial for trial in trials_in(folder) if trial.about["seed"] < options.seed + options.trials]
    metric = trials[0].experiment.curves[0].name
    return [one.last(metric) for _, one in courses(trials).values()]


def _markdown(rows: list[dict[str, Any]], options: argparse.Namespace) -> str:
    metric = experiment_of(load_scene(options.scene).experiment, Path(options.scene).parent).curves[0].label
    lines = [
        f"{metric[0].upper()}{metric[1:]} after {60 * options.minutes:g} s, mean ± sd of n = {options.trials} (seeds "
        f"{options.seed} to {options.seed + options.trials - 1}), scripted brains:",
        "",
        f"| variant | {' | '.join(options.controllers)} |",
        f"|---|{'---|' * len(options.controllers)}",
    ]
    for row in rows:
        cells = [f"{np.mean(row[c]):.2f} ± {np.std(row[c], ddof=1 if len(row[c]) > 1 else 0):.2f}"
                 for c in options.controllers]  # fmt: skip
        lines.append(f"| {row['variant']} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
