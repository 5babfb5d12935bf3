"""Trials on the workers of a Dask cluster (optional extra `cluster`); the files equal those of a local run.

Workers need this package but no shared disk. The firmware is sent with the plan, and the finished file is returned as
bytes.
"""

from __future__ import annotations

import logging
import platform
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from arena.campaign.campaign import FinishedTrial, Plan, Report, run_one, trial_path
from arena.trial.record import EXPERIMENT, write_bytes
from arena.trial.versions import versions
from emu.host.installation import install_command


class ClusterLostError(Exception):
    """The connection to the scheduler or to workers was lost; the text names the scheduler."""


def run_on(
    scheduler: str,
    plan: Plan,
    folder: Path,
    numbers: list[int],
    report: Report,
    on_finished: Callable[[FinishedTrial], None],
) -> None:
    """As `campaign.run_all`, on the workers of the scheduler at an address such as tcp://host:8786.

    Progress is reported per trial. Raises the exceptions of a trial, ValueError without Dask or for workers of another
    version, OSError if the scheduler cannot be reached, ClusterLostError if the connection is lost."""
    try:
        from distributed import CancelledError, Client, KilledWorker, as_completed
        from distributed.comm.core import CommClosedError
    except ImportError:
        raise ValueError(f"--scheduler needs Dask: {install_command('arena,cluster')}") from None
    sent = replace(plan, image=None, experiment=None, images=(), controllers=())
    files = InputFiles(
        _bytes(plan.image), _bytes(plan.experiment), [(name, _bytes(path)) for name, path in plan.images],
        [(name, path.read_bytes()) for name, path in plan.controllers],
    )  # fmt: skip
    lost = (CancelledError, KilledWorker, CommClosedError)
    with _quiet(), Client(scheduler, timeout=10) as client:
        futures = [client.submit(run_remote_trial, sent, files, number, versions(), pure=False) for number in numbers]
        try:
            for future in as_completed(futures):
                one, data = future.result()
                write_bytes(trial_path(folder, one.trial), data)
                report(one.trial, plan.seconds)
                on_finished(one)
        except lost as error:
            raise ClusterLostError(f"{scheduler}: lost while trials ran ({type(error).__name__})") from None
        except BaseException:
            client.cancel(futures)
            raise


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress the log of Dask, which has tracebacks for errors that the caller reports in one line."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    logs = [(logging.getLogger(name), logging.getLogger(name).level) for name in names]
    for log, _ in logs:
        log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for log, level in logs:
            log.setLevel(level)


class InputFiles(NamedTuple):
    """Contents of the files that a plan refers to: firmware, experiment, firmware and controllers of groups by name."""

    image: bytes | None
    experiment: bytes | None
    images: list[tuple[str, bytes | None]]
    controllers: list[tuple[str, bytes]]


def _bytes(path: Path | None) -> bytes | None:
    return path.read_bytes() if path is not None else None


def run_remote_trial(plan: Plan, files: InputFiles, number: int, wanted: dict[str, str]) -> tuple[FinishedTrial, bytes]:
    """Run one trial on a worker, in a temporary folder; return its description and its file.

    Raises ValueError if the versions of this worker are not `wanted`, because its records could differ."""
    own = versions()
    other = [f"{name} {own.get(name)} instead of {wanted[name]}" for name in wanted if own.get(name) != wanted[name]]
    if other:
        raise ValueError(f"worker on {platform.node()} has {', '.join(other)}")
    with tempfile.TemporaryDirectory(prefix="arena-") as name:
        folder = Path(name)

        def stored(label: str, data: bytes | None) -> Path | None:
            if data is None:
                return None
            path = folder / label  # the loader recognises ELF and HEX by content
            path.write_bytes(data)
            return path

        images = [(group, stored(f"firmware-{place}", data)) for place, (group, data) in enumerate(files.images)]
        controllers = []
        for place, (controller, code) in enumerate(files.controllers, start=1):
            controllers.append((controller, folder / f"controller-{place}.py"))
            controllers[-1][1].write_bytes(code)
        plan = replace(plan, image=stored("firmware", files.image), experiment=stored(EXPERIMENT, files.experiment),
                       images=tuple(images), controllers=tuple(controllers))  # fmt: skip
        one = run_one(plan, number, folder)
        return one, trial_path(folder, number).read_bytes()
