"""Options `--experiment` and `--trust`: permission to run the code of the experiment that a record names."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

from arena.experiments import experiment_with_digest, loaded_experiment
from arena.trial.record import EXPERIMENT, RecordError, Trial


def add_trust_options(command: argparse.ArgumentParser) -> None:
    """Add the two options to a command that reads records."""
    command.add_argument("--experiment", type=Path, metavar="FILE",
                         help="run the code of this experiment file if its hash is the recorded one")  # fmt: skip
    command.add_argument(
        "--trust",
        action="store_true",
        help="run the code of the experiment file that comes with the record if its hash is the recorded one; "
        "without the code, curves are the recorded ones, and objects have no groups",
    )


def load_trusted(trials: Iterable[Trial], options: argparse.Namespace) -> None:
    """Load the experiments of records from the files that the options permit.

    Raises RecordError, or SceneError for a file whose hash is not the recorded one."""
    if options.experiment is None and not options.trust:
        return
    for trial in trials:
        digest = trial.about.get("experiment_sha256")
        if digest is None:
            if str(trial.about["scene"].get("experiment", "")).endswith(".py"):
                raise RecordError(f"{trial.path}: names an experiment file but not its hash, so no file can be trusted")
        elif loaded_experiment(digest) is None:
            experiment_with_digest(options.experiment or trial.path.parent / EXPERIMENT, digest)
