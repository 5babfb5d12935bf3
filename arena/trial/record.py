"""Trials on disk: one Parquet file each, with what it was made from in its metadata, beside a manifest in JSON.

A file appears whole or not at all (written beside its place, then renamed), and the same trial gives the same bytes.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from arena.camera.appearance import NOTHING, OBJECT, ROBOT
from arena.experiments import Experiment, TrialSamples, UartLine, experiment_of
from arena.metrics import MetricSeries
from arena.scene.loader import FCY, Scene, scene_of
from arena.trial.json_numbers import misfit
from arena.trial.trial import Rows
from emu.host.files import atomic_file, is_standard, read_file

if TYPE_CHECKING:  # pyarrow is 30 MB in every process that loads it; those that only carry robots need none
    import pyarrow as pa

EXPERIMENT: Final = "experiment.py"
"""The experiment's file as it was when the run began, if it is one's own."""


FAULT: Final = (int, float, str)
"""A robot, s, why."""
MOST: Final = 1e7
"""No place in cm, time in s, speed or share of a trial comes near; what does not hold for nan, either."""
_HEAD: Final = {"scene": dict, "brain": str, "controller": str, "seed": int, "faults": [FAULT], "image_sha256?": str,
                "images_sha256?": dict, "versions?": dict}  # fmt: skip
"""What a record says of itself, at least."""


class RecordError(Exception):
    """A record cannot be written or read; the text names the file."""


class FolderInUseError(RecordError):
    """Another run writes into the same folder."""


class Columns(dict[str, Any]):
    """Columns of a trial by name. One that is not there raises RecordError: the file is damaged."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path: Final = path

    def __missing__(self, name: str) -> Any:
        raise RecordError(f"{self._path}: is no whole trial: there is no column {name}")


@dataclass(frozen=True)
class Trial:
    """One recorded trial. `columns` as in docs/experiment.md; `about` is its metadata."""

    path: Path
    columns: dict[str, Any]
    about: dict[str, Any]

    @property
    def times(self) -> NDArray[np.float64]:
        """s."""
        return np.array(self.columns["t"])

    @property
    def objects(self) -> NDArray[np.float64]:
        """samples x objects x 2, cm."""
        return self._places("o", self.scene.objects.count)

    @property
    def robots(self) -> NDArray[np.float64]:
        """samples x robots x 2, cm."""
        return self._places("r", self.scene.robots.count)

    @property
    def is_scripted(self) -> bool:
        """Whether no robot had firmware."""
        return not any((self.about.get("image_sha256"), *(self.about.get("images_sha256") or {}).values()))

    @cached_property
    def scene(self) -> Scene:
        """What it was made in. Raises SceneError for a scene this version cannot build."""
        return scene_of(self.about["scene"])

    @cached_property
    def experiment(self) -> Experiment:
        """What it is measured by. Records of before scenes named their experiment are of clustering."""
        name = str(self.about["scene"].get("experiment", "clustering"))
        beside = self.path.parent / EXPERIMENT
        return experiment_of(str(beside.resolve()) if name.endswith(".py") and beside.exists() else name)

    @cached_property
    def series(self) -> MetricSeries:
        """The metrics over time."""
        return self.experiment.series(self.samples)

    @property
    def samples(self) -> TrialSamples:
        """All samples as the experiment sees them."""
        headings = [np.asarray(self.columns[f"r{i}_heading"]) for i in range(self.robots.shape[1])]
        turned = np.stack(headings, axis=1)[:, :, None] if headings else np.zeros((len(self.times), 0, 1))
        noted = {name[2:]: np.asarray(values) for name, values in self.columns.items() if name.startswith("n_")}
        lines = [line for sample in self.columns.get("log", []) for line in sample or ()]
        said = [UartLine(line["robot"], line["cycle"] / FCY, line["text"]) for line in lines]
        said.sort(key=lambda one: one.seconds)
        robots = np.concatenate([self.robots, turned], axis=2)
        return TrialSamples(self.times, robots, self.objects, self.scene, noted, said)

    def _places(self, letter: str, count: int) -> NDArray[np.float64]:
        if not count:
            return np.zeros((len(self.times), 0, 2))
        names = [f"{letter}{i}" for i in range(count)]
        pairs = [np.column_stack([self.columns[f"{name}_x"], self.columns[f"{name}_y"]]) for name in names]
        return np.stack(pairs, axis=1)


def write_trial(path: Path, rows: Rows, about: dict[str, Any]) -> None:
    """Write a trial. Raises RecordError, for example on a full disk; then no file is left."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    arrays = {}
    for name, values in rows.columns.items():
        arrays[name] = pa.array(values, kind_of(name))
    table = pa.table(arrays).replace_schema_metadata({"arena": json.dumps(about, sort_keys=True)})
    try:
        with atomic_file(path) as part:
            pq.write_table(table, part, compression="zstd")
    except OSError as error:
        raise RecordError(f"{path}: cannot be written: {reason_of(error)}") from None


def reason_of(error: OSError) -> str:
    """The system's words; libraries add theirs."""
    return os.strerror(error.errno) if error.errno else str(error)


def kind_of(column: str) -> pa.DataType:
    """Type of a column: numbers by sample, but what robots said and showed as lists of events."""
    import pyarrow as pa

    said = pa.list_(pa.struct([("robot", pa.int16()), ("cycle", pa.int64()), ("text", pa.string())]))
    shown = pa.list_(pa.struct([("robot", pa.int16()), ("cycle", pa.int64()), ("leds", pa.int16())]))
    sent = pa.list_(
        pa.struct([("robot", pa.int16()), ("to", pa.int16()), ("cycle", pa.int64()), ("text", pa.string())])
    )
    kinds = {"log": said, "messages": sent, "lights": shown, "seen": pa.int16(), "leds": pa.int16(),
             "strip": pa.binary(), "infrared": pa.list_(pa.int16())}  # fmt: skip
    is_noted = column.startswith("n_")  # a supervisor's numbers have the names it likes
    return pa.float64() if is_noted else kinds.get(column.rsplit("_", 1)[-1], pa.float64())


def read_trial(path: Path) -> Trial:
    """Read a trial. Raises RecordError for what is none."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(pa.BufferReader(read_file(path)) if is_standard(path) else path)
        about = json.loads((table.schema.metadata or {})[b"arena"])
    except (OSError, pa.ArrowException, KeyError, ValueError, RecursionError) as error:
        raise RecordError(f"{path}: is no recorded trial: {error}") from None
    columns = Columns(path)
    columns.update({name: _values(path, name, table[name]) for name in table.column_names})
    return Trial(path, columns, checked(path, about))


def checked(path: Path, about: Any) -> dict[str, Any]:
    """What a record says of itself. Raises RecordError if something is missing or of another kind."""
    if wrong := misfit(about, _HEAD):
        raise RecordError(f"{path}: is no whole trial: {wrong}")
    return dict(about)


def _values(path: Path, name: str, column: Any) -> Any:
    """Numbers as an array, anything else as a list. Raises RecordError for a column of another kind."""
    import pyarrow as pa

    filled = column.drop_null() if name.endswith("_infrared") else column  # no round of conversions since the last
    if column.type != kind_of(name) or _has_gaps(filled):
        raise RecordError(f"{path}: is no whole trial: column {name} is not whole or not of {kind_of(name)}")
    if not pa.types.is_integer(column.type) and not pa.types.is_floating(column.type):
        return column.to_pylist()
    values = column.to_numpy()
    if name.endswith("_seen") and not np.isin(values, (-1, NOTHING, OBJECT, ROBOT)).all():
        raise RecordError(f"{path}: is no whole trial: column {name} is not of -1 to {ROBOT}")
    if not name.startswith("n_") and not (np.abs(values) < MOST).all():
        raise RecordError(f"{path}: is no whole trial: column {name} is not of numbers below {MOST:g}")
    return values


def _has_gaps(column: Any) -> bool:
    """Whether a value is missing, in whatever depth."""
    import pyarrow as pa

    return any(
        part.null_count
        or (pa.types.is_list(part.type) and _has_gaps(part.flatten()))
        or (pa.types.is_struct(part.type) and any(map(_has_gaps, part.flatten())))
        for part in getattr(column, "chunks", [column])
    )


def trials_in(folder: Path) -> list[Trial]:
    """All finished trials of a run, or the one if `folder` is a file. Raises RecordError if there is none."""
    if folder.is_file():
        return [read_trial(folder)]
    paths = sorted(folder.glob("trial-*.parquet"))
    if not paths:
        raise RecordError(f"{folder}: no finished trials (trial-*.parquet) here")
    return [read_trial(path) for path in paths]


def write_json(path: Path, value: Any) -> None:
    """Write JSON whole or not at all. Raises RecordError."""
    write_text(path, json.dumps(value, indent=2, sort_keys=True, default=str) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all. Raises RecordError."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file whole or not at all; a device or pipe as it is. Raises RecordError."""
    try:
        with atomic_file(path) as part:
            part.write_bytes(data)
    except OSError as error:
        raise RecordError(f"{path}: cannot be written: {reason_of(error)}") from None
