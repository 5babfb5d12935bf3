"""`arena experiment SCENE`: run every arm of the registered comparison and write its report."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from arena.analysis.comparison import NEAR_S
from arena.analysis.report import with_results
from arena.campaign.campaign import check_folder
from arena.commands import report
from arena.commands import run as single
from arena.commands.options.arguments import count, count_or_none, duration
from arena.commands.options.plan import DEFAULT_CONTROLLER, plan_from
from arena.robots.epuck import SELECTOR
from emu.host.errors import CommandParser

EXAMPLE = "example: arena experiment clustering --document docs/experiment-appendix.md --figures docs/figures"


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(
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
    """Run all arms and the report; return the highest exit status. Raises as `run` and `report`.

    All arguments are checked before the first trial."""
    if not options.controllers or set(options.controllers) - set(SELECTOR):
        raise ValueError(f"--controllers {options.controllers}: expected some of {''.join(SELECTOR)}")
    if options.trials < 2:
        raise ValueError("--trials must be 2 or more for a comparison")
    arms = _arms(options)
    _check_report(options)
    _check_arms(arms, options.at)
    status = max(single.run(arm) for arm in arms)
    arguments = [*(str(arm.out) for arm in arms), "--at", str(options.at)]
    for name in ("document", "figures"):
        if getattr(options, name) is not None:
            arguments += [f"--{name}", str(getattr(options, name))]
    return max(status, report.run(report.parser().parse_args(arguments)))


def _arms(options: argparse.Namespace) -> list[argparse.Namespace]:
    """Return the options of `arena run` for every arm."""
    brains = [(brain, options.trials, options.minutes) for brain in options.brains.split(",")]
    if options.twins:
        brains.append(("scripted", options.twins, options.twin_minutes))
    arms = []
    for controller in options.controllers:
        for brain, trials, minutes in brains:
            arguments = [options.scene, "--brain", brain, "--trials", str(trials), "--minutes", str(minutes),
                         "--seed", str(options.seed), "--jobs", str(options.jobs),
                         "--out", str(options.out / f"{Path(brain).stem}-{controller}")]  # fmt: skip
            if options.controllers != DEFAULT_CONTROLLER:  # a scene with a fixed controller refuses the option
                arguments += ["--controller", controller]
            if options.scheduler is not None:
                arguments += ["--scheduler", options.scheduler]
            arms.append(single.parser().parse_args(arguments))
    return arms


def _check_arms(arms: list[argparse.Namespace], at: float) -> None:
    """Raise an exception if an arm cannot run or does not last until `at`. Builds the firmware of the arms."""
    folders = [arm.out for arm in arms]
    for folder in folders:
        if folders.count(folder) > 1:
            raise ValueError(f"two arms have the folder {folder}: give the brains different names and each one once, "
                             "and leave the scripted trials out with --twins 0 if `scripted` is one of --brains"
                             )  # fmt: skip
    for arm in arms:
        if 60 * arm.minutes < at - NEAR_S:
            raise ValueError(f"the trials of {arm.out} last {60 * arm.minutes:g} s, less than --at {at:g}")
        check_folder(plan_from(arm, arm.trials), arm.out)


def _check_report(options: argparse.Namespace) -> None:
    """Raise an exception if the report cannot be written where the options say."""
    if options.document is not None:
        with_results(options.document.read_text(encoding="utf-8"), "")
    if options.figures is not None:
        options.figures.mkdir(parents=True, exist_ok=True)
