"""`arena figures RESULTS`: draw every figure of docs/experiment-appendix.md from the runs in one folder."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Final

from arena.analysis import plots
from arena.analysis.report import by_controller
from arena.commands import run as single
from arena.replay import filmstrip
from arena.trial.record import RecordError, Trial, trials_in
from emu.host.errors import CommandParser

FILM: Final = ["clustering", "--brain", "openswarm", "--controller", "A", "--trials", "1", "--minutes", "0.5", "--set",
               "clock.sample_s=0.1"]  # fmt: skip
"""Arguments of `arena run` for the short trial of the filmstrip."""
FILM_ROBOT: Final = 4


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(
        description="draw all figures of a study: one set per controller, and the filmstrip of one robot",
        epilog="example: arena figures results --out docs/figures",
    )
    command.add_argument(
        "results", type=Path, metavar="RESULTS", help="folder of `arena experiment` with one folder per run"
    )
    command.add_argument(
        "--out", type=Path, default=Path("docs/figures"), metavar="FOLDER", help="default docs/figures"
    )
    command.add_argument("--no-film", action="store_true", help="omit the filmstrip, whose trial is run if missing")
    return command


def run(options: argparse.Namespace) -> int:
    """Write the figures and print their paths. Raises RecordError, ValueError, OSError."""
    folders = sorted(path for path in options.results.glob("*") if any(path.glob("trial-*.parquet")))
    runs = {path.name: trials_in(path) for path in folders if path.name != "film"}
    if not runs and options.no_film:
        raise RecordError(f"{options.results}: no folder of a run with finished trials")
    options.out.mkdir(parents=True, exist_ok=True)
    for controller, group in by_controller(runs).items():
        _print_paths(plots.draw_all(group, options.out, "png", f"{controller}-"))
    scripted = {name: trials for name, trials in runs.items() if trials[0].is_scripted}
    if len(scripted) > 1:
        _print_paths(plots.draw_all(scripted, options.out, "png", "scripted-", ["snapshots", "curves"]))
    if not options.no_film:
        _print_paths([_draw_filmstrip(options.results / "film", options.out / "film.png")])
    return 0


def _draw_filmstrip(folder: Path, path: Path) -> Path:
    single.run(single.parser().parse_args([*FILM, "--out", str(folder)]))
    trial: Trial = trials_in(folder)[0]
    filmstrip.draw_filmstrip(trial, FILM_ROBOT).savefig(path, dpi=100)
    print("\n".join(filmstrip.log_lines(trial, FILM_ROBOT)))
    return path


def _print_paths(paths: list[Path]) -> None:
    for path in paths:
        print(path)
