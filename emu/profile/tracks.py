"""What happened in order, as tracks: one for every stack of the firmware and one for every interrupt level.

What enters: turns. What leaves: `TrackEvent`s in the order of time: something begins or ends on a track. While a track
does not run nothing is open on it; what was open is opened again when it goes on. So the open time of all tracks is the
time in which the CPU worked.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Final, NamedTuple

from emu.profile.call_graph import CLOSE, OPEN, SLEEP, SWITCH, CallEvent

THREAD_START: Final = "_os_thread_start"
"""What calls a thread's function (firmware/openswarm/port/dspic30f/switch.S)."""
MAIN: Final = (0, 0)
"""The track of the first stack."""
Track = tuple[int, int]
"""Stack and how many there were on it before; of a handler -1 and the CPU priority."""


class TrackEvent(NamedTuple):
    """Something begins or ends."""

    cycle: int
    track: Track
    begins: bool
    entry: int
    is_new: bool
    """It is called, or returns; otherwise it only goes on, or waits."""
    since: int = 0
    """Of a handler that is entered: the cycle of the request."""
    site: int = 0
    """Program address of the call."""


class Tracks:
    """Follows turns. `name_of` gives the function around an address; marks are given of the cycles from `start` to
    `end`; the program began at `entry`."""

    def __init__(self, turns: Iterable[CallEvent], name_of: Callable[[int], str], start: int, end: int, entry: int) -> None:
        self._name_of: Final = name_of
        self._stacks: Final[dict[int, list[tuple[int, int | None]]]] = {0: [(entry, None)]}
        """Frames by stack: entry, and the level of a handler."""
        self._times: Final[Counter[int]] = Counter()
        """How often a stack has been begun anew."""
        self._current = 0
        self._names: Final[dict[Track, str]] = {MAIN: "main"}
        self.marks: Final = list(self._marks(turns, start, end))
        """Everything that can be seen, in order of time."""

    def title(self, track: Track) -> str:
        """Name of a track: that of the thread's function, `level 4`."""
        if track[0] < 0:
            return f"level {track[1]}"
        return self._names.get(track, f"stack {track[0]}")

    def _marks(self, turns: Iterable[CallEvent], start: int, end: int) -> Iterator[TrackEvent]:
        begun = False
        for turn in turns:
            if not begun and turn.cycle > start:
                begun = True
                yield from self._go_on(start)
            for mark in self._turn(turn):
                if begun:
                    yield mark
        if not begun:
            yield from self._go_on(start)
        yield from self._wait(end)

    def _turn(self, turn: CallEvent) -> Iterator[TrackEvent]:
        stack = self._stacks.setdefault(turn.stack, [])
        if turn.what == SWITCH:
            yield from self._wait(turn.cycle)
            self._current = turn.stack
            self._times[turn.stack] += not stack
            yield from self._go_on(turn.cycle)
        elif turn.what == SLEEP:
            yield from self._wait(turn.cycle - turn.length)
            yield from self._go_on(turn.cycle)
        elif turn.what == OPEN:
            level = turn.raised - 1 if turn.raised else None
            if level is not None:
                yield from self._wait(turn.cycle)
            stack.append((turn.entry, level))
            yield TrackEvent(turn.cycle, self._track(), True, turn.entry, True, turn.since, turn.site)
        elif turn.what == CLOSE and stack:
            track = self._track()
            entry, level = stack.pop()
            yield TrackEvent(turn.cycle, track, False, entry, True)
            if level is not None:
                yield from self._go_on(turn.cycle)

    def _track(self) -> Track:
        """That of the highest interrupt level on the present stack, or of its thread."""
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
        """The frames that are open on the present track."""
        stack = self._stacks[self._current]
        return stack[max((n for n, (_, level) in enumerate(stack) if level is not None), default=0) :]

    def _wait(self, cycle: int) -> Iterator[TrackEvent]:
        track = self._track()
        for entry, _ in reversed(self._running()):
            yield TrackEvent(cycle, track, False, entry, False)

    def _go_on(self, cycle: int) -> Iterator[TrackEvent]:
        track = self._track()
        for entry, _ in self._running():
            yield TrackEvent(cycle, track, True, entry, False)
