"""`arena sensitivity SCENE`: vary one registered scene value at a time, with scripted robots
(experiment-contract.md §5)."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np

from arena.analysis.comparison import series_by_seed
from arena.campaign.campaign import Plan, locked_folder, open_folder
from arena.commands.options.arguments import count, count_or_none, duration
from arena.commands.options.plan import folder_name, with_overrides
from arena.commands.run import run_with_progress
from arena.experiments import experiment_file, experiment_of
from arena.robots.epuck import SELECTOR
from arena.scene.loader import load_scene, scripted
from arena.trial.record import EXPERIMENT, trials_in, write_bytes, write_text
from arena.trial.strict_json import json_text
from emu.host.errors import CommandParser

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
"""Variants within the ranges of docs/experiment-appendix.md §2. A pitch of -0.38 degrees shifts the picture by four
rows; the second row of the window then shows robots up to 135 cm away."""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(
        description="vary one scene value at a time with scripted robots and print the experiment's first metric",
        epilog="example: arena sensitivity clustering --trials 10 --minutes 10 --save results/sensitivity.md",
    )
    command.add_argument("scene", metavar="SCENE", help="name of a scene (see `arena scenes`) or TOML file")
    command.add_argument("--controllers", default="AB", help="speed tables to vary (default AB)")
    command.add_argument("--trials", type=count, default=10, metavar="N", help="trials per variant (default 10)")
    command.add_argument(
        "--minutes", type=duration, default=10.0, metavar="M", help="simulated minutes per trial (default 10)"
    )
    command.add_argument("--seed", type=count_or_none, default=1, help="seed of the first trial (default 1)")
    command.add_argument(
        "--only", action="append", metavar="TEXT", help="run only variants whose names contain TEXT; repeatable"
    )
    command.add_argument(
        "--jobs", type=count, default=os.cpu_count() or 1, metavar="N", help="cores to use (default: all)"
    )
    command.add_argument(
        "--out", type=Path, default=Path("results/sensitivity"), metavar="FOLDER", help="default results/sensitivity"
    )
    command.add_argument("--save", type=Path, metavar="FILE", help="also write the table to a Markdown file")
    command.add_argument("--json", action="store_true", help="print JSON")
    return command


def run(options: argparse.Namespace) -> int:
    """Run all variants and print the table. Raises SceneError, RecordError, ValueError."""
    if not options.controllers or set(options.controllers) - set(SELECTOR):
        raise ValueError(f"--controllers {options.controllers}: expected some of {''.join(SELECTOR)}")
    wanted = [name for name in VARIANTS if not options.only or any(text in name for text in options.only)]
    if not wanted:
        raise ValueError(f"--only {options.only}: no such variant; known: {'; '.join(VARIANTS)}")
    rows: list[dict[str, Any]] = []
    for name in wanted:
        row: dict[str, Any] = {"variant": name}
        for controller in options.controllers:
            row[controller] = _final_values(options, name, controller)
        rows.append(row)
    text = _markdown(rows, options)
    if options.save is not None:
        write_text(options.save, text)
    print(json_text({"sensitivity": rows}) if options.json else text, end="" if not options.json else "\n")
    return 0


def _final_values(options: argparse.Namespace, name: str, controller: str) -> list[float]:
    """Return the experiment's first metric at the end of each trial."""
    scene = scripted(with_overrides(load_scene(options.scene), VARIANTS[name]))
    own = experiment_file(scene.experiment, Path(options.scene).parent)
    plan = Plan(scene, "scripted", controller, None, options.trials, 60 * options.minutes, options.seed, own)
    folder = options.out / f"{folder_name(name)}-{controller}"
    with locked_folder(folder):
        if own is not None:
            write_bytes(folder / EXPERIMENT, own.read_bytes())
        run_with_progress(plan, folder, open_folder(plan, folder, sys.argv[1:]), options.jobs)
    trials = [trial for trial in trials_in(folder) if trial.about["seed"] < options.seed + options.trials]
    metric = trials[0].experiment.curves[0].name
    return [one.last(metric) for _, one in series_by_seed(trials).values()]


def _markdown(rows: list[dict[str, Any]], options: argparse.Namespace) -> str:
    metric = experiment_of(load_scene(options.scene).experiment, Path(options.scene).parent).curves[0].label
    lines = [
        f"{metric[0].upper()}{metric[1:]} after {60 * options.minutes:g} s, mean ± sd of n = {options.trials} (seeds "
        f"{options.seed} to {options.seed + options.trials - 1}), scripted controllers:",
        "",
        f"| variant | {' | '.join(options.controllers)} |",
        f"|---|{'---|' * len(options.controllers)}",
    ]
    for row in rows:
        cells = [f"{np.mean(row[c]):.2f} ± {np.std(row[c], ddof=1 if len(row[c]) > 1 else 0):.2f}"
                 for c in options.controllers]  # fmt: skip
        lines.append(f"| {row['variant']} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
