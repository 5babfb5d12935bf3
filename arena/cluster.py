"""Trials on the workers of a Dask cluster (optional extra `cluster`). What enters: a plan; what leaves: the same files.

Workers need this package but no shared disk: the image travels with the plan, the finished file comes back as bytes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from arena.campaign import Done, Plan, Report, run_one, trial_path
from arena.record import write_bytes


def run_on(
    scheduler: str, plan: Plan, folder: Path, numbers: list[int], report: Report, done: Callable[[Done], None]
) -> None:
    """As `campaign.run_all`, on the workers of the scheduler at an address such as tcp://host:8786. Progress is told
    per trial. Raises ValueError without Dask, OSError if nobody answers there, and what a trial raises."""
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise ValueError("--scheduler needs Dask: pip install 'openswarm[arena,cluster]'") from None
    image = plan.image.read_bytes() if plan.image is not None else None
    sent = replace(plan, image=None)
    with Client(scheduler, timeout=10) as client:
        futures = [client.submit(trial_elsewhere, sent, image, number, pure=False) for number in numbers]
        try:
            for future in as_completed(futures):
                one, data = future.result()
                write_bytes(trial_path(folder, one.trial), data)
                report(one.trial, plan.seconds)
                done(one)
        except BaseException:
            client.cancel(futures)
            raise


def trial_elsewhere(plan: Plan, image: bytes | None, number: int) -> tuple[Done, bytes]:
    """One trial in a folder of its own: what it was, and its file."""
    with tempfile.TemporaryDirectory(prefix="arena-") as name:
        folder = Path(name)
        if image is not None:
            path = folder / "firmware"  # the loader tells ELF from HEX by content
            path.write_bytes(image)
            plan = replace(plan, image=path)
        one = run_one(plan, number, folder)
        return one, trial_path(folder, number).read_bytes()
