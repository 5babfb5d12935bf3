"""`arena run SCENE`: run trials of one brain and controller into a folder."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any, NamedTuple

from arena.campaign.campaign import FinishedTrial, Plan, locked_folder, open_folder, run_all
from arena.campaign.interrupt import kept_interrupts
from arena.commands.options.arguments import count, removed_processes
from arena.commands.options.plan import add_plan, copy_inputs, plan_from
from arena.commands.options.progress import ProgressDisplay
from arena.trial.manifest import note_host_time
from arena.trial.record import Trial, trials_in
from arena.trial.strict_json import json_text
from emu.host.errors import CommandParser

EXAMPLE = "example: arena run clustering --brain openswarm --controller A --trials 10 --jobs 2 --out results/os-A"


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(description="run trials; finished ones are kept and skipped", epilog=EXAMPLE)
    command.add_argument("--trials", type=count, default=10, metavar="N", help="number of trials (default 10)")
    add_plan(command)
    command.add_argument(
        "--jobs",
        type=count,
        default=os.cpu_count() or 1,
        metavar="N",
        help="cores to use (default: all): concurrent trials, or threads of one trial if there are fewer trials",
    )
    command.add_argument(
        "--processes",
        type=removed_processes,
        help=argparse.SUPPRESS,
    )
    command.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on a Dask cluster instead, for example tcp://host:8786"
    )
    command.add_argument("--out", type=Path, metavar="FOLDER", help="default results/SCENE-BRAIN-CONTROLLER")
    command.add_argument("--json", action="store_true", help="print the results as JSON")
    return command


def run(options: argparse.Namespace) -> int:
    """Run the missing trials and print the results; exit status 1 if a robot had a fault.

    Raises SceneError, RecordError, LoadError, ValueError."""
    result = run_missing_trials(options)
    if options.json:
        print(json_text({"folder": str(result.folder), "trials": list(map(summary, result.trials)), "new": result.new}))
    else:
        print_result(result)
    return 1 if result.faults else 0


class RunResult(NamedTuple):
    """Result of a run: all its trials, the number of new ones, and whether a robot had a fault."""

    folder: Path
    trials: list[Trial]
    new: int
    faults: bool


def print_result(result: RunResult) -> None:
    """Print a line per trial and the number of trials."""
    print("\n".join(map(result_line, result.trials)))
    print(f"{len(result.trials)} trials in {result.folder}")


def run_missing_trials(options: argparse.Namespace) -> RunResult:
    """Run the missing trials and return all. Raises as `run`."""
    plan = plan_from(options, options.trials)
    folder = options.out or Path("results") / f"{plan.scene.name}-{plan.brain}-{plan.controller.removesuffix('.py')}"
    with locked_folder(folder):
        missing = open_folder(plan, folder, sys.argv[1:])
        plan = copy_inputs(plan, folder)
        faults = run_with_progress(plan, folder, missing, options.jobs, options.scheduler)
    wanted = {f"trial-{number:04d}.parquet" for number in range(1, options.trials + 1)}
    trials = [trial for trial in trials_in(folder) if trial.path.name in wanted]
    return RunResult(folder, trials, len(missing), bool(faults))


def summary(trial: Trial) -> dict[str, Any]:
    """Return the last value of every curve and every measure of one trial."""
    series, end = trial.series, float(trial.times[-1])
    curves = {one.name: series.last(one.name) for one in trial.experiment.curves}
    measures = {one.name: one.of(series, end) for one in trial.experiment.measures}
    about = {"trial": trial.path.stem, "seed": trial.about["seed"], "seconds": end, "faults": trial.about["faults"]}
    return curves | measures | about


def result_line(trial: Trial) -> str:
    """Return the last value of every curve of one trial as a line of text."""
    series, curves = trial.series, trial.experiment.curves
    values = ", ".join(f"{one.label} {one.shown(series.last(one.name))}" for one in curves)
    return f"{trial.path.stem}: seed {trial.about['seed']}, after {trial.times[-1]:g} s: {values}"


def run_with_progress(plan: Plan, folder: Path, missing: list[int], jobs: int, scheduler: str | None = None) -> bool:
    """Run trials on local workers or on a Dask cluster; return whether a robot had a fault."""
    has_fault = False
    with kept_interrupts() as check_interrupt, ProgressDisplay(len(missing), plan.seconds) as display:

        def report(trial: int, seconds: float) -> None:
            check_interrupt()
            display.update(trial, seconds)

        def on_finished(one: FinishedTrial) -> None:
            nonlocal has_fault
            display.complete(one.trial, one.host_s)
            note_host_time(folder, one.trial, one.host_s, one.faults)
            for robot, seconds, why in one.faults:
                has_fault = True
                display.print(f"trial {one.trial}, {seconds:.1f} s: robot {robot} {why}")
            check_interrupt()

        if scheduler is not None and missing:
            from arena.campaign.cluster import run_on

            run_on(scheduler, plan, folder, missing, report, on_finished)
        else:
            run_all(plan, folder, missing, jobs, report, on_finished)
    return has_fault
