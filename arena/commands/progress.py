"""How far a run is: bars on a terminal, plain lines into a file or a pipe."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Final

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

EVERY_S: Final = 10.0
"""Between plain lines of a trial that goes on."""


class Told:
    """Progress of `trials` of `seconds` simulated time each, on standard error."""

    def __init__(self, trials: int, seconds: float) -> None:
        self._console = Console(stderr=True)
        self._is_plain = not self._console.is_terminal
        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"),
                   TimeRemainingColumn())  # fmt: skip
        self._bars = Progress(*columns, console=self._console, disable=self._is_plain, transient=True)
        self._trials = trials
        self._seconds = seconds
        self._whole = self._bars.add_task(f"{trials} trials", total=max(trials * seconds, 1))
        self._bar: dict[int, TaskID] = {}
        self._reached: dict[int, float] = {}
        self._done = 0
        self._next_line = time.monotonic() + EVERY_S

    def __enter__(self) -> Told:
        self._bars.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._bars.stop()

    def line(self, text: str) -> None:
        """Something to read beside the progress."""
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)

    def reached(self, trial: int, seconds: float) -> None:
        """A trial has come to `seconds` of simulated time."""
        self._reached[trial] = max(seconds, self._reached.get(trial, 0.0))
        if self._is_plain:
            if time.monotonic() >= self._next_line:
                self._tell(f"trial {trial} at {seconds:.0f} of {self._seconds:.0f} s")
            return
        if trial not in self._bar:
            self._bar[trial] = self._bars.add_task(f"  trial {trial}", total=self._seconds)
        self._bars.update(self._bar[trial], completed=seconds)
        self._bars.update(self._whole, completed=sum(self._reached.values()))

    def finished(self, trial: int, host_s: float) -> None:
        """A trial is done, in so many seconds of this or another host."""
        self._done += 1
        self.reached(trial, self._seconds)
        if self._is_plain:
            self._tell(f"trial {trial} done in {host_s:.1f} s, {self._done} of {self._trials}")
        else:
            self._bars.remove_task(self._bar.pop(trial))

    def _tell(self, text: str) -> None:
        share = sum(self._reached.values()) / max(self._trials * self._seconds, 1e-9)
        self.line(f"{text} ({share:.0%} of all)")
        self._next_line = time.monotonic() + EVERY_S
