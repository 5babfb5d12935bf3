"""`arena experiment SCENE`: run every arm of the registered comparison and write its report."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from arena.commands import report
from arena.commands import run as single
from arena.commands.arguments import count, count_or_none, duration
from arena.robots.reactive import SPEED_TABLES

EXAMPLE = "example: arena experiment clustering --document docs/experiment.md --figures docs/figures"


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = argparse.ArgumentParser(
        description="run all combinations of brains and controllers, then write the report; finished trials are kept",
        epilog=EXAMPLE,
    )
    command.add_argument("scene", metavar="SCENE", help="name of a scene (see `arena scenes`) or TOML file")
    command.add_argument(
        "--brains", default="openswarm,bare", metavar="B1,B2", help="firmware to compare (default openswarm,bare)"
    )
    command.add_argument("--controllers", default="AB", help="speed tables to compare (default AB)")
    command.add_argument(
        "--trials", type=count, default=10, metavar="N", help="trials per brain and controller (default 10)"
    )
    command.add_argument(
        "--minutes", type=duration, default=15.0, metavar="M", help="simulated minutes per trial (default 15)"
    )
    command.add_argument(
        "--twins", type=count_or_none, default=100, metavar="N", help="scripted trials per controller (default 100)"
    )
    command.add_argument(
        "--twin-minutes",
        type=duration,
        default=10.0,
        metavar="M",
        help="simulated minutes per scripted trial (default 10)",
    )
    command.add_argument(
        "--at", type=duration, default=600.0, metavar="S", help="simulated time of the measures (default 600 s)"
    )
    command.add_argument("--seed", type=count_or_none, default=1, help="seed of the first trial (default 1)")
    command.add_argument(
        "--jobs", type=count, default=os.cpu_count() or 1, metavar="N", help="worker processes (default: all cores)"
    )
    command.add_argument("--scheduler", metavar="ADDRESS", help="run on a Dask cluster instead")
    command.add_argument("--out", type=Path, default=Path("results"), metavar="FOLDER", help="default results")
    command.add_argument(
        "--document", type=Path, metavar="FILE", help="replace the results in this document; default: standard output"
    )
    command.add_argument("--figures", type=Path, metavar="FOLDER", help="draw the figures into this folder")
    return command


def run(options: argparse.Namespace) -> int:
    """Run all arms and the report; return the highest exit status. Raises as `run` and `report`."""
    if not options.controllers or set(options.controllers) - set(SPEED_TABLES):
        raise ValueError(f"--controllers {options.controllers}: expected some of {''.join(SPEED_TABLES)}")
    if options.trials < 2:
        raise ValueError("--trials must be 2 or more for a comparison")
    arms = [(brain, options.trials, options.minutes) for brain in options.brains.split(",")]
    if options.twins:
        arms.append(("scripted", options.twins, options.twin_minutes))
    folders = []
    status = 0
    for controller in options.controllers:
        for brain, trials, minutes in arms:
            folders.append(options.out / f"{Path(brain).stem}-{controller}")
            arguments = [options.scene, "--brain", brain, "--controller", controller, "--trials", str(trials),
                         "--minutes", str(minutes), "--seed", str(options.seed), "--jobs", str(options.jobs),
                         "--out", str(folders[-1])]  # fmt: skip
            if options.scheduler is not None:
                arguments += ["--scheduler", options.scheduler]
            status = max(status, single.run(single.parser().parse_args(arguments)))
    arguments = [*map(str, folders), "--at", str(options.at)]
    for name in ("document", "figures"):
        if getattr(options, name) is not None:
            arguments += [f"--{name}", str(getattr(options, name))]
    return max(status, report.run(report.parser().parse_args(arguments)))
