"""Progress display: bars on a terminal, plain lines in a file or pipe."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Final

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

LINE_INTERVAL_S: Final = 10.0
"""Least time, in seconds, between plain lines about a running trial."""


class ProgressDisplay:
    """Progress of `trials` trials of `seconds` simulated seconds each, on standard error."""

    def __init__(self, trials: int, seconds: float) -> None:
        self._console = Console(stderr=True)
        self._is_plain = not self._console.is_terminal
        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"),
                   TimeRemainingColumn())  # fmt: skip
        self._bars = Progress(*columns, console=self._console, disable=self._is_plain, transient=True)
        self._trials = trials
        self._seconds = seconds
        self._total_bar = self._bars.add_task(f"{trials} trials", total=max(trials * seconds, 1))
        self._trial_bars: dict[int, TaskID] = {}
        self._reached: dict[int, float] = {}
        self._done = 0
        self._next_line = time.monotonic() + LINE_INTERVAL_S

    def __enter__(self) -> ProgressDisplay:
        self._bars.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._bars.stop()

    def print(self, text: str) -> None:
        """Print a line above the progress bars."""
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)

    def update(self, trial: int, seconds: float) -> None:
        """Show that a trial has reached `seconds` of simulated time."""
        self._reached[trial] = max(seconds, self._reached.get(trial, 0.0))
        if self._is_plain:
            if time.monotonic() >= self._next_line:
                self._print_line(f"trial {trial} at {seconds:.0f} of {self._seconds:.0f} s")
            return
        if trial not in self._trial_bars:
            self._trial_bars[trial] = self._bars.add_task(f"  trial {trial}", total=self._seconds)
        self._bars.update(self._trial_bars[trial], completed=seconds)
        self._bars.update(self._total_bar, completed=sum(self._reached.values()))

    def complete(self, trial: int, host_s: float) -> None:
        """Show that a trial has finished after `host_s` seconds of host time."""
        self._done += 1
        self.update(trial, self._seconds)
        if self._is_plain:
            self._print_line(f"trial {trial} done in {host_s:.1f} s, {self._done} of {self._trials}")
        else:
            self._bars.remove_task(self._trial_bars.pop(trial))

    def _print_line(self, text: str) -> None:
        share = sum(self._reached.values()) / max(self._trials * self._seconds, 1e-9)
        self.print(f"{text} ({share:.0%} of all)")
        self._next_line = time.monotonic() + LINE_INTERVAL_S
