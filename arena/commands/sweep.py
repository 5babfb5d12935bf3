"""`arena sweep SCENE --vary SECTION.KEY=V1,V2 ...`: run every combination of scene values and print a table."""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path
from typing import Any

import numpy as np

from arena.analysis.comparison import series_by_seed
from arena.commands import run as single
from arena.commands.options.plan import folder_name
from arena.trial.record import trials_in
from arena.trial.strict_json import json_text

EXAMPLE = "example: arena sweep clustering --brain scripted --vary camera.range_cm=100,150,inf --vary robots.count=3,5"


def parser() -> argparse.ArgumentParser:
    """Return the parser of the options of `run` and the grid of values."""
    command = single.parser()
    command.description, command.epilog = "run every combination of the given scene values and print a table", EXAMPLE
    command.add_argument("--vary", action="append", default=[], required=True, metavar="SECTION.KEY=V1,V2,...",
                      help="scene value and its alternatives; repeatable")  # fmt: skip
    return command


def run(options: argparse.Namespace) -> int:
    """Run the grid and print the table; return the highest exit status. Raises as `run`."""
    axes = []
    for axis in options.vary:
        place, equals, values = axis.partition("=")
        if not equals or not values:
            raise ValueError(f"--vary {axis!r}: expected SECTION.KEY=V1,V2,...")
        axes.append([f"{place}={value}" for value in values.split(",")])
    base = options.out or Path("results") / f"sweep-{folder_name(Path(options.scene).stem)}"
    quiet = argparse.Namespace(**vars(options))
    status = 0
    rows: list[dict[str, Any]] = []
    for settings in itertools.product(*axes):
        quiet.set = [*options.set, *settings]
        quiet.out = base / "-".join(map(folder_name, settings))
        result = single.run_missing_trials(quiet)
        status, trials = max(status, int(result.faults)), trials_in(quiet.out)
        if not options.json:
            single.print_result(result)
        done = [one for _, one in series_by_seed(trials).values()]
        curves = trials[0].experiment.curves
        ends = {one.name: [series.last(one.name) for series in done] for one in curves}
        spreads = {name: {"mean": float(np.mean(values)), "sd": float(np.std(values, ddof=min(1, len(done) - 1)))}
                   for name, values in ends.items()}  # fmt: skip
        rows.append({"values": settings, "n": len(done), "metrics": spreads})
    if options.json:
        print(json_text({"sweep": rows}))
    else:
        for row in rows:
            shown = [f"{name} {one['mean']:.3g} sd {one['sd']:.2g}" for name, one in row["metrics"].items()]
            print(f"{', '.join(row['values']):50} n {row['n']:3}  {'  '.join(shown)}")
    return status
