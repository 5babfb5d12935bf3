"""`arena plot FOLDER...`: draw figures from recorded trials."""

from __future__ import annotations

import argparse
from pathlib import Path

from arena.analysis import plots
from arena.commands.options.arguments import count_or_none
from arena.commands.options.trust import add_trust_options, load_trusted
from arena.replay import filmstrip
from arena.trial.record import Trial, trials_in
from emu.host.errors import CommandParser


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(
        description="draw snapshots, clustering over time, trajectories and CPU load",
        epilog="example: arena plot results/clustering-openswarm-A results/clustering-bare-A --out figures",
    )
    command.add_argument("runs", nargs="+", type=Path, metavar="FOLDER", help="folder of a run")
    command.add_argument("--out", type=Path, default=Path("figures"), metavar="FOLDER", help="default figures")
    command.add_argument("--film", type=count_or_none, metavar="ROBOT",
                      help="draw the filmstrip of one robot of the first trial, and print its log")  # fmt: skip
    command.add_argument("--format", default="png", choices=("png", "svg", "pdf"), help="default png")
    add_trust_options(command)
    return command


def run(options: argparse.Namespace) -> int:
    """Write the figures and print their paths. Raises RecordError, OSError."""
    runs = {folder.name: trials_in(folder) for folder in options.runs}
    load_trusted((trial for trials in runs.values() for trial in trials), options)
    options.out.mkdir(parents=True, exist_ok=True)
    if options.film is not None:
        return _draw_filmstrips(runs, options)
    for path in plots.draw_all(runs, options.out, options.format):
        print(path)
    return 0


def _draw_filmstrips(runs: dict[str, list[Trial]], options: argparse.Namespace) -> int:
    for name, trials in runs.items():
        robots = trials[0].scene.robots.count
        if not 0 <= options.film < robots:
            raise ValueError(f"--film {options.film}: {name} has robots 0 to {robots - 1}")
        path = options.out / f"{name}-film.{options.format}"
        filmstrip.draw_filmstrip(trials[0], options.film).savefig(path, dpi=100)
        print("\n".join(filmstrip.log_lines(trials[0], options.film)))
        print(path)
    return 0
