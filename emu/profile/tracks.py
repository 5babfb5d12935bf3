"""Tracks of a timeline: one per firmware stack and one per interrupt level.

Input: call events. Output: `TrackEvent`s sorted by time. While a track is suspended, no function is open on it; its
functions are reopened when it resumes. The open time of all tracks is therefore the busy time of the CPU.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Final, NamedTuple

from emu.profile.call_graph import CLOSE, OPEN, SLEEP, SWITCH, CallEvent

THREAD_START: Final = "_os_thread_start"
"""Assembly function that calls a thread's function (firmware/openswarm/port/dspic30f/switch.S)."""
MAIN: Final = (0, 0)
"""Track of the first stack."""
Track = tuple[int, int]
"""A thread: (number of its stack, number of earlier threads on it). An interrupt handler: (-1, CPU priority)."""


class TrackEvent(NamedTuple):
    """Begin or end of a function's slice on a track."""

    cycle: int
    track: Track
    begins: bool
    entry: int
    is_new: bool
    """Whether the cause is a call or return; False for a resumption or suspension of the track."""
    since: int = 0
    """For the entry of a handler: cycle of the interrupt request."""
    site: int = 0
    """Program address of the call instruction."""


class Tracks:
    """Converts call events to track events.

    `name_of(pc)` returns the function that contains an address. Track events cover the cycles from `start` to `end`.
    The program began at `entry`.
    """

    def __init__(
        self, events: Iterable[CallEvent], name_of: Callable[[int], str], start: int, end: int, entry: int
    ) -> None:
        self._name_of: Final = name_of
        self._stacks: Final[dict[int, list[tuple[int, int | None]]]] = {0: [(entry, None)]}
        """Open frames by stack: entry address, and the level if it is a handler."""
        self._times: Final[Counter[int]] = Counter()
        """Number of threads that have started on a stack."""
        self._current = 0
        self._names: Final[dict[Track, str]] = {MAIN: "main"}
        self.events: Final = list(self._track_events(events, start, end))
        """All track events sorted by time."""

    def title(self, track: Track) -> str:
        """Return the title of a track: the name of the thread's function, or `level 4`."""
        if track[0] < 0:
            return f"level {track[1]}"
        return self._names.get(track, f"stack {track[0]}")

    def _track_events(self, events: Iterable[CallEvent], start: int, end: int) -> Iterator[TrackEvent]:
        begun = False
        for event in events:
            if not begun and event.cycle > start:
                begun = True
                yield from self._resume(start)
            for track_event in self._process(event):
                if begun:
                    yield track_event
        if not begun:
            yield from self._resume(start)
        yield from self._suspend(end)

    def _process(self, event: CallEvent) -> Iterator[TrackEvent]:
        stack = self._stacks.setdefault(event.stack, [])
        if event.what == SWITCH:
            yield from self._suspend(event.cycle)
            self._current = event.stack
            self._times[event.stack] += not stack
            yield from self._resume(event.cycle)
        elif event.what == SLEEP:
            yield from self._suspend(event.cycle - event.length)
            yield from self._resume(event.cycle)
        elif event.what == OPEN:
            level = event.raised - 1 if event.raised else None
            if level is not None:
                yield from self._suspend(event.cycle)
            stack.append((event.entry, level))
            yield TrackEvent(event.cycle, self._track(), True, event.entry, True, event.since, event.site)
        elif event.what == CLOSE and stack:
            track = self._track()
            entry, level = stack.pop()
            yield TrackEvent(event.cycle, track, False, entry, True)
            if level is not None:
                yield from self._resume(event.cycle)

    def _track(self) -> Track:
        """Return the track of the highest interrupt level on the current stack; without interrupts, of its thread."""
        stack = self._stacks[self._current]
        for _, level in reversed(stack):
            if level is not None:
                return -1, level
        track = self._current, self._times[self._current]
        if track not in self._names:
            names = [self._name_of(entry) for entry, _ in stack[:2]]
            if names and names[-1] != THREAD_START:
                self._names[track] = names[names[0] == THREAD_START].removeprefix("_")
        return track

    def _running(self) -> list[tuple[int, int | None]]:
        """Return the open frames of the current track."""
        stack = self._stacks[self._current]
        return stack[max((n for n, (_, level) in enumerate(stack) if level is not None), default=0) :]

    def _suspend(self, cycle: int) -> Iterator[TrackEvent]:
        track = self._track()
        for entry, _ in reversed(self._running()):
            yield TrackEvent(cycle, track, False, entry, False)

    def _resume(self, cycle: int) -> Iterator[TrackEvent]:
        track = self._track()
        for entry, _ in self._running():
            yield TrackEvent(cycle, track, True, entry, False)
