"""`arena compare X Y`: compare two runs seed by seed with equivalence tests (experiment-contract.md §5)."""

from __future__ import annotations

import argparse
from pathlib import Path

from arena.analysis.comparison import compare_runs
from arena.commands.options.arguments import duration
from arena.commands.options.trust import add_trust_options, load_trusted
from arena.trial.record import trials_in
from arena.trial.strict_json import json_text
from emu.host.errors import CommandParser


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(
        description="compare two runs by equivalence tests",
        epilog="example: arena compare results/clustering-openswarm-A results/clustering-bare-A",
    )
    command.add_argument("first", type=Path, metavar="X", help="folder of a run")
    command.add_argument("second", type=Path, metavar="Y", help="folder of another run")
    command.add_argument(
        "--at", type=duration, default=600.0, metavar="S", help="simulated time of the measures (default 600 s)"
    )
    command.add_argument("--json", action="store_true", help="print JSON")
    add_trust_options(command)
    return command


def run(options: argparse.Namespace) -> int:
    """Print the comparison of all measures. Raises RecordError, ValueError."""
    first, second = trials_in(options.first), trials_in(options.second)
    load_trusted([*first, *second], options)
    result = compare_runs(first, second, options.at)
    if options.json:
        print(json_text(result))
        return 0
    print(f"X = {options.first}\nY = {options.second}\n{len(result['seeds'])} seeds in common")
    for row in result["measures"]:
        x, y = row["first"], row["second"]
        verdict = "equivalent" if row["equivalent"] else "equivalence not shown"
        chance = f"p = {row['p']:.3f}; Wilcoxon p = {row['wilcoxon_p']:.3f}"
        added = row["exact"]
        print(f"{row['measure']}\n    X {x['mean']:.3f} sd {x['sd']:.3f}   Y {y['mean']:.3f} sd {y['sd']:.3f}\n"
              f"    X - Y {row['mean']:+.3f}, 90 % interval {row['low']:+.3f} to {row['high']:+.3f}, "
              f"margin {row['margin']:.3f}: {verdict} ({chance})\n"
              f"    exact (added): 90 % interval {added['low']:+.3f} to {added['high']:+.3f}, p = {added['p']:.3f}, "
              f"at least {added['least_p']:.2g} with {added['differ']} pairs that differ\n"
              f"    X - Y by seed: {' '.join(f'{one - other:+.3g}' for one, other in row['pairs'])}")  # fmt: skip
        if row["remark"]:
            print(f"    {row['remark']}")
    loads = ["no CPU" if load is None else f"{load:.1%}" for load in result["cpu_load"]]
    print(f"CPU load: X {loads[0]}, Y {loads[1]}")
    for one in result["apart"]:
        print(f"robots of the same seed after {one['seconds']:g} s: {one['median_cm']:.2f} cm apart (median), "
              f"at most {one['max_cm']:.2f} cm")  # fmt: skip
    if result["published"]:
        print(f"Published: {result['published']}")
    return 0
