"""`arena figures RESULTS`: every figure of docs/experiment.md from the runs in one folder, by one command."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Final

from arena.analysis import plots
from arena.analysis.report import by_controller
from arena.commands import run as single
from arena.replay import filmstrip
from arena.trial.record import RecordError, Trial, trials_in

FILM: Final = ["clustering", "--brain", "openswarm", "--controller", "A", "--trials", "1", "--minutes", "0.5", "--set",
               "clock.sample_s=0.1"]  # fmt: skip
"""The short trial of which one robot's way is drawn."""
FILM_ROBOT: Final = 4


def parser() -> argparse.ArgumentParser:
    """Options of the command."""
    made = argparse.ArgumentParser(
        description="draw all figures of a study: by controller over all its runs, and what one robot saw and did",
        epilog="example: arena figures results --out docs/figures",
    )
    made.add_argument(
        "results", type=Path, metavar="RESULTS", help="folder with the runs' folders, as experiment makes"
    )
    made.add_argument("--out", type=Path, default=Path("docs/figures"), metavar="FOLDER")
    made.add_argument("--no-film", action="store_true", help="leave out the film strip, whose trial is run if missing")
    return made


def run(options: argparse.Namespace) -> int:
    """Write the figures and name them. Raises RecordError, ValueError, OSError."""
    folders = sorted(path for path in options.results.glob("*") if any(path.glob("trial-*.parquet")))
    runs = {path.name: trials_in(path) for path in folders if path.name != "film"}
    if not runs and options.no_film:
        raise RecordError(f"{options.results}: no run's folder with finished trials here")
    options.out.mkdir(parents=True, exist_ok=True)
    for controller, group in by_controller(runs).items():
        _say(plots.draw_all(group, options.out, "png", f"{controller}-"))
    scripted = {name: trials for name, trials in runs.items() if trials[0].is_scripted}
    if len(scripted) > 1:
        _say(plots.draw_all(scripted, options.out, "png", "scripted-", ["snapshots", "curves"]))
    if not options.no_film:
        _say([_film(options.results / "film", options.out / "film.png")])
    return 0


def _film(folder: Path, path: Path) -> Path:
    single.run(single.parser().parse_args([*FILM, "--out", str(folder)]))
    trial: Trial = trials_in(folder)[0]
    filmstrip.film(trial, FILM_ROBOT).savefig(path, dpi=100)
    print("\n".join(filmstrip.log(trial, FILM_ROBOT)))
    return path


def _say(paths: list[Path]) -> None:
    for path in paths:
        print(path)
