"""`arena replay TRIAL`: a page that plays a trial, without a server."""

from __future__ import annotations

import argparse
from pathlib import Path

from arena.page import page
from arena.record import RecordError, read_trial, write_text


def parser() -> argparse.ArgumentParser:
    """Options of the command."""
    made = argparse.ArgumentParser(
        description="make an HTML page that plays a trial",
        epilog="example: arena replay results/clustering-scripted-A/trial-0001.parquet --out trial.html",
    )
    made.add_argument("trial", type=Path, metavar="TRIAL", help="a trial-NNNN.parquet")
    made.add_argument("--out", type=Path, metavar="FILE", help="default: the trial's name with .html")
    return made


def run(options: argparse.Namespace) -> int:
    """Write the page and name it. Raises RecordError."""
    if not options.trial.is_file():
        raise RecordError(f"{options.trial}: no such file; expected a trial-NNNN.parquet")
    out = options.out or options.trial.with_suffix(".html")
    write_text(out, page(read_trial(options.trial)))
    print(out)
    return 0
