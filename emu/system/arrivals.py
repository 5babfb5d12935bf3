"""Arrivals at hooked program addresses: counts, and a log that native code and Python append to.

Input: the state record, the numbers to log. Output: the count of each address, and a list of entries. An arrival is
recorded before the instruction at the address runs, with the numbers that it finds.
"""

from __future__ import annotations

import ctypes
from array import array
from dataclasses import dataclass
from typing import Final

from emu.system.record import Record

LOGGED, COUNTS = 0, 1
"""Words of the memory: number of entries; number of arrivals by place. Entries follow."""
ROOM: Final = 4096
"""Maximum number of entries in the memory. Python empties it when it is full."""


@dataclass(frozen=True, slots=True)
class LoggedNumber:
    """Unsigned number of `size` bytes (1, 2, 4 or 8) at `address`: in RAM, or of W registers."""

    address: int
    size: int


@dataclass(frozen=True, slots=True)
class Recording:
    """What native code does at an address: it counts the arrival and, with `first`, logs the cycle and `numbers`."""

    place: int
    """Number of the address in the log."""
    first: int | None
    """Word of the first entry; None without a log."""
    numbers: tuple[LoggedNumber, ...]

    @property
    def entry_words(self) -> int:
        """Number of words of an entry: cycle, place, numbers."""
        return 2 + len(self.numbers)


class ArrivalLog:
    """Counts of arrivals at `places` addresses and, if `is_logged`, an entry for each."""

    def __init__(self, record: Record, places: int, numbers: tuple[LoggedNumber, ...], is_logged: bool) -> None:
        self._record: Final = record
        self._cycle: Final = record.fields["cpu.cycle"].index
        self._places: Final = places
        self._width: Final = 2 + len(numbers)
        self._first: Final = COUNTS + places
        self._words: Final = (ctypes.c_uint64 * (self._first + (self._width * ROOM if is_logged else 0)))()
        self.address: Final = ctypes.addressof(self._words)
        """Host address of the memory."""
        self._full: Final = array("Q")
        """Entries that were taken from the memory when it was full."""
        first = self._first if is_logged else None
        self.hooks: Final = [ArrivalHook(self, Recording(place, first, numbers)) for place in range(places)]

    @property
    def counts(self) -> list[int]:
        """Return the number of arrivals by place."""
        return self._words[COUNTS : COUNTS + self._places]

    def entries(self) -> list[list[int]]:
        """Return all entries in order: cycle, place, numbers."""
        words = [*self._full, *self._words[self._first : self._first + self._width * self._words[LOGGED]]]
        return [words[at : at + self._width] for at in range(0, len(words), self._width)]

    def add(self, recording: Recording) -> None:
        """Record an arrival in the present cycle."""
        words = self._words
        words[COUNTS + recording.place] += 1
        if recording.first is None:
            return
        if words[LOGGED] == ROOM:
            self._full.frombytes(memoryview(self._words).cast("B")[8 * self._first :])
            words[LOGGED] = 0
        data, at = self._record.bytes, self._first + self._width * words[LOGGED]
        numbers = [int.from_bytes(data[one.address : one.address + one.size], "little") for one in recording.numbers]
        words[at : at + self._width] = [self._record.u64[self._cycle], recording.place, *numbers]
        words[LOGGED] += 1


class ArrivalHook:
    """Hook that records arrivals. Native code records them itself if it is the only hook of its address."""

    def __init__(self, log: ArrivalLog, recording: Recording) -> None:
        self.log: Final = log
        self.recording: Final = recording

    def __call__(self) -> None:
        """Record an arrival."""
        self.log.add(self.recording)
