"""Live feed of a running trial: a file with one JSON line per row, and a reader for the live page.

The file exists only while the trial runs. A failed write, for example on a full disk, does not stop the trial.
"""

from __future__ import annotations

import base64
import json
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from filelock import FileLock, Timeout

from arena.experiments.declaration import CURVE_COLUMN
from arena.replay.page import page, sample_data
from arena.trial.record import RecordError, Trial, checked, read_trial


def live_path(folder: Path, number: int) -> Path:
    """Return the path of the live file of trial `number`, counted from 1."""
    return folder / f"trial-{number:04d}.live"


def _lock(path: Path) -> FileLock:
    """Return the lock that the writer holds; the system releases the lock of a killed process."""
    return FileLock(path.with_name(path.name + ".lock"), timeout=0, thread_local=False)


class LiveFile:
    """Writer of a live file: first the metadata of the trial, then its rows."""

    def __init__(self, path: Path, about: dict[str, Any]) -> None:
        self._path = path
        self._file: BinaryIO | None = None
        self._end_at = 0
        """Offset of the next row. After a rewind, later bytes are rows of the process that had run further."""
        self._lock = _lock(path)
        with suppress(OSError, Timeout):
            self._lock.acquire()
            self._file = path.open("wb")
        self.write(about)

    def write(self, row: dict[str, Any]) -> None:
        """Write one line; do nothing after a write has failed."""
        if self._file is None:
            return
        try:
            line = json.dumps(row, default=lambda data: base64.b64encode(data).decode()) + "\n"
            self._file.seek(self._end_at)
            self._file.truncate()
            self._end_at += self._file.write(line.encode())
            self._file.flush()
        except OSError:
            self._end()

    def close(self) -> None:
        """Delete the file and release its lock, at the end of the trial or after an exception."""
        self._end()
        held = self._lock.is_locked
        self._lock.release()
        if held:
            for path in (self._path, Path(self._lock.lock_file)):
                with suppress(OSError):
                    path.unlink()

    def _end(self) -> None:
        if self._file is not None:
            with suppress(OSError):
                self._file.close()
        self._file = None


class Follower:
    """Reader of the rows of a running trial: number `number`, or the newest one.

    Raises RecordError if no such trial is running."""

    def __init__(self, folder: Path, number: int | None = None) -> None:
        running = [live_path(folder, number)] if number is not None else list(folder.glob("trial-*.live"))
        running = sorted((path for path in running if path.exists()), key=lambda path: path.stat().st_mtime)
        if not running:
            raise RecordError(f"{folder}: no trial is running here (trial-*.live)")
        self._path = running[-1]
        self._offset = 0
        self._about: dict[str, Any] = {}
        self._rows: list[dict[str, Any]] = []
        self._finished: Trial | None = None

    def metadata(self) -> list[Trial]:
        """Return the trial without its samples, or an empty list if its metadata is not written yet."""
        self._catch_up()
        return [Trial(self._path, {}, self._about)] if self._about else []

    def page(self) -> str:
        """Return a page with all samples so far, which polls for new ones."""
        self._catch_up()
        return page(self._trial(0), live=True)

    def more(self, first: int) -> dict[str, Any]:
        """Return the samples from number `first` on, and the state: `running`, `done`, or `aborted` before the end."""
        state = self._catch_up()
        samples = len(self._finished.times) if self._finished is not None else len(self._rows)
        found = sample_data(self._trial(first)) if samples > first else {}
        return found | {"state": state}

    def _catch_up(self) -> str:
        """Read the new rows; return the state: `running`, `done` or `aborted`."""
        if self._finished is not None:
            return "done"
        try:
            with self._path.open(encoding="utf-8") as file:
                file.seek(self._offset)
                text = file.read()
        except OSError:
            whole = self._path.with_suffix(".parquet")
            if not whole.exists():
                return "aborted"
            self._finished = read_trial(whole)
            return "done"
        complete = text[: text.rfind("\n") + 1]
        self._offset += len(complete.encode())
        for line in complete.splitlines():
            if not self._about:
                self._about = checked(self._path, json.loads(line))
            else:
                self._rows.append(_decoded(json.loads(line)))
        return "running" if self._is_written() else "aborted"

    def _is_written(self) -> bool:
        """Whether the writer of the file is still running, or has just finished the trial."""
        try:
            with _lock(self._path):
                return not self._path.exists() or self._path.with_suffix(".parquet").exists()
        except Timeout:
            return True
        except OSError:
            return True  # without write access to the folder the lock cannot be tested

    def _trial(self, first: int) -> Trial:
        """Return the samples from number `first` on as a trial."""
        whole = self._finished
        if whole is not None:
            shown = [name for name in whole.columns if not name.startswith(CURVE_COLUMN)]  # the columns of rows
            return Trial(whole.path, {name: whole.columns[name][first:] for name in shown}, whole.about)
        rows = self._rows[first:]
        if not rows:
            raise RecordError(f"{self._path}: no sample is recorded yet; try again in a moment")
        return Trial(self._path, {name: [row[name] for row in rows] for name in rows[0]}, self._about)


def _decoded(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row with its camera strips as bytes."""
    return {name: base64.b64decode(value) if name.endswith("_strip") else value for name, value in row.items()}
