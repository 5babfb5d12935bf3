"""The manifest of a run: what its trials depend on, the host it ran on, and the host time of each trial."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from arena.trial.record import FAULT, RecordError, write_json
from arena.trial.strict_json import mismatch

MANIFEST: Final = "manifest.json"
_SHAPE: Final = {
    "key": {"scene": dict, "brain": str, "controller": str, "seconds": float, "seed": int, "image_sha256?": str,
            "images_sha256?": dict, "experiment_sha256?": str, "controllers_sha256?": dict, "versions": dict},
    "host": [{"trial": int, "host_s": float, "faults": [FAULT]}],
}  # fmt: skip


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest of a run. Raises RecordError if it is missing or invalid."""
    path = folder / MANIFEST
    try:
        value: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise RecordError(f"{path}: {error}") from None
    if wrong := mismatch(value, _SHAPE):
        raise RecordError(f"{path}: is not the manifest of a run: {wrong}")
    return value


def write_manifest(folder: Path, value: dict[str, Any]) -> None:
    """Write the manifest atomically. Raises RecordError."""
    write_json(folder / MANIFEST, value)


def note_host_time(folder: Path, trial: int, host_s: float, faults: object) -> None:
    """Add the host time and the faults of a trial. They are not in the record, whose bytes must not depend on the host.

    Raises RecordError.
    """
    value = read_manifest(folder)
    value["host"].append({"trial": trial, "host_s": round(host_s, 2), "faults": faults})
    write_manifest(folder, value)
