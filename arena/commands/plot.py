"""`arena plot FOLDER...`: figures from recorded trials."""

from __future__ import annotations

import argparse
from pathlib import Path

from arena import plots
from arena.record import trials_in


def parser() -> argparse.ArgumentParser:
    """Options of the command."""
    made = argparse.ArgumentParser(
        description="draw snapshots, clustering over time, trajectories and CPU load",
        epilog="example: arena plot results/clustering-openswarm-A results/clustering-bare-A --out figures",
    )
    made.add_argument("runs", nargs="+", type=Path, metavar="FOLDER")
    made.add_argument("--out", type=Path, default=Path("figures"), metavar="FOLDER")
    made.add_argument("--format", default="png", choices=("png", "svg", "pdf"))
    return made


def run(options: argparse.Namespace) -> int:
    """Write the figures and name them. Raises RecordError, OSError."""
    runs = {folder.name: trials_in(folder) for folder in options.runs}
    options.out.mkdir(parents=True, exist_ok=True)
    for path in plots.draw_all(runs, options.out, options.format):
        print(path)
    return 0
