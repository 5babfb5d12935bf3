"""`arena report FOLDER...`: write tables and figures of runs as Markdown, to standard output or into a document."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np

from arena.analysis import plots
from arena.analysis.report import by_controller, report, with_results
from arena.commands.options.arguments import duration
from arena.commands.options.trust import add_trust_options, load_trusted
from arena.trial.manifest import read_manifest
from arena.trial.record import trials_in, write_text
from emu.host.errors import CommandParser


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(
        description="write tables and figures of runs as Markdown, grouped by controller",
        epilog="example: arena report results/openswarm-A results/bare-A results/openswarm-B results/bare-B "
        "--document docs/experiment-appendix.md --figures docs/figures",
    )
    command.add_argument("runs", nargs="+", type=Path, metavar="FOLDER", help="folder of a run")
    command.add_argument(
        "--document", type=Path, metavar="FILE", help="replace the results in this document; default: standard output"
    )
    command.add_argument(
        "--at", type=duration, default=600.0, metavar="S", help="simulated time of the measures (default 600 s)"
    )
    command.add_argument(
        "--figures", type=Path, metavar="FOLDER", help="draw snapshots, curves and CPU load into this folder"
    )
    add_trust_options(command)
    return command


def run(options: argparse.Namespace) -> int:
    """Write the report. Raises RecordError, ValueError, OSError."""
    runs = {folder.name: trials_in(folder) for folder in options.runs}
    load_trusted((trial for trials in runs.values() for trial in trials), options)
    if len(runs) < len(options.runs):
        raise ValueError("two of the folders have the same name; the tables need distinct names")
    home = options.document.parent if options.document is not None else Path()
    figures: dict[str, list[str]] = {}
    if options.figures is not None:
        options.figures.mkdir(parents=True, exist_ok=True)
        for controller, group in by_controller(runs).items():
            names = ["snapshots", "curves", "cpu-load"]
            paths = plots.draw_all(group, options.figures, "png", prefix=f"{controller}-", names=names)
            figures[controller] = [Path(os.path.relpath(path, home)).as_posix() for path in paths]
    text = report(runs, figures, {folder.name: _host_s(folder) for folder in options.runs}, options.at)
    if options.document is None:
        print(text, end="")
        return 0
    write_text(options.document, with_results(options.document.read_text(encoding="utf-8"), text))
    print(options.document)
    return 0


def _host_s(folder: Path) -> float:
    """Return the mean host time of a trial in s; nan if the manifest has none."""
    noted = read_manifest(folder)["host"]
    return float(np.mean([one["host_s"] for one in noted])) if noted else float("nan")
