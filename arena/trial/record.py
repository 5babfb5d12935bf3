"""Records of trials: one Parquet file each, with its inputs in the metadata.

Files are written atomically (to a temporary file, which is then renamed). The same trial gives the same bytes.
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
from arena.experiments import Experiment, LedEvent, TrialSamples, UartLine, experiment_of, loaded_experiment
from arena.experiments.declaration import CURVE_COLUMN, SHAPE, declared_experiment
from arena.metrics import MetricSeries
from arena.scene.loader import FCY, Scene, scene_of
from arena.trial.strict_json import mismatch
from arena.trial.trial import Rows
from emu.host.files import atomic_file, is_standard, read_file
from emu.host.result_tables import data_frame, html_table

if TYPE_CHECKING:  # pyarrow takes 30 MB in every process that loads it, and running a trial does not need it
    import pyarrow as pa

EXPERIMENT: Final = "experiment.py"
"""Copy of the user's experiment file in the folder of a run, made when the run began."""
FAULT: Final = (int, float, str)
"""JSON shape of a fault: robot, seconds, description."""
FREE_COLUMNS: Final = ("n_", CURVE_COLUMN)
"""Prefixes of the columns whose names and values come from the experiment: noted numbers and curves."""
MAX_VALUE: Final = 1e7
"""Bound of all numbers of a record: positions in cm, times in s, speeds, shares. nan is refused too."""
_HEAD: Final = {"scene": dict, "brain": str, "controller": str, "seed": int, "faults": [FAULT], "image_sha256?": str,
                "controllers_sha256?": dict,
                "images_sha256?": dict, "versions?": dict, "experiment_sha256?": str, "experiment?": SHAPE}  # fmt: skip
"""JSON shape of the metadata."""


class RecordError(Exception):
    """A record cannot be written or read; the message names the file."""


class FolderInUseError(RecordError):
    """Another run writes into the same folder."""


class Columns(dict[str, Any]):
    """Columns of a trial by name. A missing one raises RecordError."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path: Final = path

    def __missing__(self, name: str) -> Any:
        raise RecordError(f"{self._path}: is not a complete trial: column {name} is missing")


@dataclass(frozen=True)
class Trial:
    """One recorded trial.

        >>> from pathlib import Path
        >>> from arena.trial.record import trials_in
        >>> trial = trials_in(Path("build/study"))[0]      # of `arena run clustering --out build/study`
        >>> trial.about["seed"], float(trial.times[0]), trial.robots[0, 0].shape     # x, y in cm
        (1, 0.0, (2,))
        >>> "r0_x" in trial.columns                         # of type Columns
        True
        >>> 0 < trial.series.last("share") <= 1
        True

    docs/experiment-appendix.md explains `columns`; `about` is the metadata.
    """

    path: Path
    columns: dict[str, Any]
    about: dict[str, Any]

    def __repr__(self) -> str:
        robots = sum(name.startswith("r") and name.endswith("_heading") for name in self.columns)
        span = float(self.times[-1]) if len(self.times) else 0.0
        return f"<trial of {robots} robots, {span:g} s, seed {self.about['seed']}, {len(self.about['faults'])} faults>"

    def frame(self) -> Any:
        """Return one row per sample as a pandas DataFrame, with the columns and units of the record (arena/README.md).

        Raises ModuleNotFoundError without pandas.
        """
        names = list(self.columns)
        return data_frame([dict(zip(names, row, strict=True)) for row in zip(*self.columns.values(), strict=True)])

    def _repr_html_(self) -> str:
        """Return the metrics at the last sample as an HTML table for notebooks. Raises SceneError as `scene`."""
        last = [
            {"metric": one.label, "at the end": one.shown(self.series.last(one.name))} for one in self.experiment.curves
        ]
        return html_table(last, repr(self)[1:-1])

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the samples, s."""
        return np.array(self.columns["t"])

    @property
    def objects(self) -> NDArray[np.float64]:
        """Positions of the objects: samples x objects x 2, cm."""
        return self._places("o", self.scene.objects.count)

    @cached_property
    def object_poses(self) -> list[list[tuple[float, ...]]]:
        """Poses of the objects by sample: x and y in cm, and of a polygon the heading in rad."""
        found = self.objects.tolist()
        for number in range(self.scene.objects.count):
            if self.scene.kind_of(number).polygon:
                for sample, heading in enumerate(self.columns[f"o{number}_heading"]):
                    found[sample][number].append(float(heading))
        return [[tuple(place) for place in sample] for sample in found]

    @property
    def robots(self) -> NDArray[np.float64]:
        """Positions of the robots: samples x robots x 2, cm."""
        return self._places("r", self.scene.robots.count)

    @property
    def is_scripted(self) -> bool:
        """Whether all robots had scripted controllers."""
        return not any((self.about.get("image_sha256"), *(self.about.get("images_sha256") or {}).values()))

    @cached_property
    def scene(self) -> Scene:
        """Scene of the trial. Raises SceneError if this version cannot build it."""
        return scene_of(self.about["scene"])

    @cached_property
    def experiment(self) -> Experiment:
        """Experiment of the trial; `clustering` if the scene in the record names none.

        A record never loads a file. A user's experiment is the one that this process has loaded from a file with the
        recorded hash, otherwise the declaration in the record."""
        name = str(self.about["scene"].get("experiment", "clustering"))
        if not name.endswith(".py"):
            return experiment_of(name)
        loaded = loaded_experiment(self.about.get("experiment_sha256") or "")
        return loaded or declared_experiment(Path(name).stem, self.about.get("experiment"), self.columns)

    @cached_property
    def series(self) -> MetricSeries:
        """The metrics over time; the recorded ones if the code of the experiment is not loaded."""
        if not self.experiment.is_declaration:
            return self.experiment.series(self.samples)
        recorded = {one.name: self.columns[CURVE_COLUMN + one.name] for one in self.experiment.curves}
        return MetricSeries(self.times, {name: np.asarray(values, dtype=float) for name, values in recorded.items()})

    @property
    def samples(self) -> TrialSamples:
        """All samples as the experiment sees them."""
        headings = [np.asarray(self.columns[f"r{i}_heading"]) for i in range(self.robots.shape[1])]
        turned = np.stack(headings, axis=1)[:, :, None] if headings else np.zeros((len(self.times), 0, 1))
        noted = {name[2:]: np.asarray(values) for name, values in self.columns.items() if name.startswith("n_")}
        lines = [line for sample in self.columns.get("log", []) for line in sample or ()]
        heard = [UartLine(line["robot"], line["cycle"] / FCY, line["text"]) for line in lines]
        heard.sort(key=lambda one: one.seconds)
        robots = np.concatenate([self.robots, turned], axis=2)
        lights = [change for sample in self.columns.get("lights", []) for change in sample or ()]
        shown = [LedEvent(change["robot"], change["cycle"] / FCY, change["leds"]) for change in lights]
        shown.sort(key=lambda one: one.seconds)
        return TrialSamples(self.times, robots, self.objects, self.scene, noted, heard, shown)

    def _places(self, letter: str, count: int) -> NDArray[np.float64]:
        """Return the positions of the bodies whose columns begin with a letter."""
        if not count:
            return np.zeros((len(self.times), 0, 2))
        names = [f"{letter}{i}" for i in range(count)]
        pairs = [np.column_stack([self.columns[f"{name}_x"], self.columns[f"{name}_y"]]) for name in names]
        return np.stack(pairs, axis=1)


def write_trial(path: Path, rows: Rows, about: dict[str, Any]) -> None:
    """Write a trial. Raises RecordError, for example on a full disk, and then leaves no file."""
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
    """Return the operating system's text of an error, without additions of libraries."""
    return os.strerror(error.errno) if error.errno else str(error)


def kind_of(column: str) -> pa.DataType:
    """Return the type of a column: a number per sample, or a list of events for log, messages and lights."""
    import pyarrow as pa

    said = pa.list_(pa.struct([("robot", pa.int16()), ("cycle", pa.int64()), ("text", pa.string())]))
    shown = pa.list_(pa.struct([("robot", pa.int16()), ("cycle", pa.int64()), ("leds", pa.int16())]))
    sent = pa.list_(
        pa.struct([("robot", pa.int16()), ("to", pa.int16()), ("cycle", pa.int64()), ("text", pa.string())])
    )
    kinds = {"log": said, "messages": sent, "lights": shown, "seen": pa.int16(), "leds": pa.int16(),
             "strip": pa.binary(), "infrared": pa.list_(pa.int16())}  # fmt: skip
    is_free = column.startswith(FREE_COLUMNS)  # names chosen by the experiment may end with a key of `kinds`
    return pa.float64() if is_free else kinds.get(column.rsplit("_", 1)[-1], pa.float64())


def read_trial(path: Path) -> Trial:
    """Read a trial. Raises RecordError if the file is not one."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(pa.BufferReader(read_file(path)) if is_standard(path) else path)
        about = json.loads((table.schema.metadata or {})[b"arena"])
    except (OSError, pa.ArrowException, KeyError, ValueError, RecursionError) as error:
        raise RecordError(f"{path}: is not a recorded trial: {' '.join(str(error).split())}") from None
    columns = Columns(path)
    columns.update({name: _values(path, name, table[name]) for name in table.column_names})
    return Trial(path, columns, checked(path, about))


def checked(path: Path, about: Any) -> dict[str, Any]:
    """Return the metadata of a record. Raises RecordError if a value is missing or of the wrong type."""
    if wrong := mismatch(about, _HEAD):
        raise RecordError(f"{path}: is not a complete trial: {wrong}")
    return dict(about)


def _values(path: Path, name: str, column: Any) -> Any:
    """Return a column: numbers as an array, others as a list. Raises RecordError for a wrong type or value."""
    import pyarrow as pa

    filled = column.drop_null() if name.endswith("_infrared") else column  # null: no conversions since the last sample
    if column.type != kind_of(name) or _has_gaps(filled):
        raise RecordError(f"{path}: is not a complete trial: column {name} has gaps or is not of type {kind_of(name)}")
    if not pa.types.is_integer(column.type) and not pa.types.is_floating(column.type):
        return column.to_pylist()
    values = column.to_numpy()
    if name.endswith("_seen") and not np.isin(values, (-1, NOTHING, OBJECT, ROBOT)).all():
        raise RecordError(f"{path}: is not a complete trial: column {name}: expected -1 to {ROBOT}")
    if not name.startswith(FREE_COLUMNS) and not (np.abs(values) < MAX_VALUE).all():
        raise RecordError(f"{path}: is not a complete trial: column {name}: expected numbers below {MAX_VALUE:g}")
    return values


def _has_gaps(column: Any) -> bool:
    """Whether a value is missing at any depth of a nested column."""
    import pyarrow as pa

    return any(
        part.null_count
        or (pa.types.is_list(part.type) and _has_gaps(part.flatten()))
        or (pa.types.is_struct(part.type) and any(map(_has_gaps, part.flatten())))
        for part in getattr(column, "chunks", [column])
    )


def trials_in(folder: Path) -> list[Trial]:
    """Return all finished trials of a run, or the one in the file. Raises RecordError if there is none."""
    if folder.is_file():
        return [read_trial(folder)]
    paths = sorted(folder.glob("trial-*.parquet"))
    if not paths:
        raise RecordError(f"{folder}: no finished trials (trial-*.parquet) here")
    return [read_trial(path) for path in paths]


def write_json(path: Path, value: Any) -> None:
    """Write JSON atomically. Raises RecordError."""
    write_text(path, json.dumps(value, indent=2, sort_keys=True, default=str) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically. Raises RecordError."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file atomically; devices and pipes are written directly. Raises RecordError."""
    try:
        with atomic_file(path) as part:
            part.write_bytes(data)
    except OSError as error:
        raise RecordError(f"{path}: cannot be written: {reason_of(error)}") from None
