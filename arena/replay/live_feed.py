"""A trial that is still going on: rows in a file beside its place, one JSON line each, and whoever follows them.

The file is there only while the trial runs. Nothing depends on it: a disk too full for it does not stop the trial.
"""

from __future__ import annotations

import base64
import json
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from filelock import FileLock, Timeout

from arena.replay.page import page, samples_of
from arena.trial.record import RecordError, Trial, checked, read_trial


def live_path(folder: Path, number: int) -> Path:
    """Where the rows of a running trial are, counted from 1."""
    return folder / f"trial-{number:04d}.live"


def _lock(path: Path) -> FileLock:
    """Held while a trial runs: the system gives it free when its process is killed."""
    return FileLock(path.with_name(path.name + ".lock"), timeout=0, thread_local=False)


class LiveFile:
    """Writes: first what the trial is, then its rows."""

    def __init__(self, path: Path, about: dict[str, Any]) -> None:
        self._path = path
        self._file: BinaryIO | None = None
        self._end_at = 0
        """Where the next row begins. Behind it is only what a process wrote that was further than this copy of it."""
        self._lock = _lock(path)
        with suppress(OSError, Timeout):
            self._lock.acquire()
            self._file = path.open("wb")
        self.write(about)

    def write(self, row: dict[str, Any]) -> None:
        """One line; after the first that fails no more are tried."""
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
        """The trial is over, one way or the other."""
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
    """Reads what there is of a trial of a run: the newest running one, or `number`. Raises RecordError if none is."""

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

    def page(self) -> str:
        """A page with all samples so far, which asks for more."""
        self._catch_up()
        return page(self._trial(0), live=True)

    def more(self, first: int) -> dict[str, Any]:
        """Samples from `first` on. `state`: running, done, or gone (the run was ended before the trial was done, by
        whatever means)."""
        state = self._catch_up()
        samples = len(self._finished.times) if self._finished is not None else len(self._rows)
        found = samples_of(self._trial(first)) if samples > first else {}
        return found | {"state": state}

    def _catch_up(self) -> str:
        if self._finished is not None:
            return "done"
        try:
            with self._path.open(encoding="utf-8") as file:
                file.seek(self._offset)
                text = file.read()
        except OSError:
            whole = self._path.with_suffix(".parquet")
            if not whole.exists():
                return "gone"
            self._finished = read_trial(whole)
            return "done"
        complete = text[: text.rfind("\n") + 1]
        self._offset += len(complete.encode())
        for line in complete.splitlines():
            if not self._about:
                self._about = checked(self._path, json.loads(line))
            else:
                self._rows.append(_decoded(json.loads(line)))
        return "running" if self._is_written() else "gone"

    def _is_written(self) -> bool:
        """Whether the process that writes the file is still alive, or has just finished it."""
        try:
            with _lock(self._path):
                return not self._path.exists() or self._path.with_suffix(".parquet").exists()
        except Timeout:
            return True
        except OSError:
            return True  # a folder one may not write to: nothing can be told

    def _trial(self, first: int) -> Trial:
        """The samples from `first` on."""
        whole = self._finished
        if whole is not None:
            return Trial(whole.path, {name: values[first:] for name, values in whole.columns.items()}, whole.about)
        rows = self._rows[first:]
        if not rows:
            raise RecordError(f"{self._path}: nothing is recorded yet; try again in a moment")
        return Trial(self._path, {name: [row[name] for row in rows] for name in rows[0]}, self._about)


def _decoded(row: dict[str, Any]) -> dict[str, Any]:
    return {name: base64.b64decode(value) if name.endswith("_strip") else value for name, value in row.items()}
