"""Where every cycle goes: instructions, functions, interrupt levels, Idle, and who called whom. Counted, not sampled.

What enters: a machine with its image. What leaves: a `Profile`, whose numbers add up to the cycles run. Entering an
exception (the forced NOPs and pushes, isa.md §14.2) counts for the handler that is entered, at its level.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from fnmatch import fnmatch
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from emu.debug.inspector import Inspector
from emu.dspic30f.cycle_accounting import CycleAccounting
from emu.image.model import Image
from emu.profile.call_graph import CallEdge, CallEvent, CallGraph

if TYPE_CHECKING:
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

Place = tuple[str, str, int]
"""Function, source file and line; "" and 0 for code without lines."""


@dataclass(slots=True)
class Profile:
    """Cycles by what they were spent on."""

    entry: int = 0
    """Program address at which the machine stood before."""
    start: int = 0
    """First cycle that is counted."""
    end: int = 0
    idle: int = 0
    """In Idle or Sleep."""
    addresses: dict[int, int] = field(default_factory=dict)
    """By the first program address of a source line's stretch of code."""
    places: Counter[Place] = field(default_factory=Counter)
    """By function, source file and line: code that was inlined keeps its file."""
    levels: Counter[int] = field(default_factory=Counter)
    """By CPU priority: 0 to 7, traps 8 and above."""
    edges: list[CallEdge] = field(default_factory=list)
    """Who called whom, how often, for how long."""
    turns: Iterable[CallEvent] = ()
    """What happened in order, if it was asked for: to be gone through once."""
    stop: Stop | None = None
    """What ended the run before its time."""

    @property
    def functions(self) -> Counter[str]:
        """By function, without what it calls."""
        return self._summed(0)

    @property
    def files(self) -> Counter[str]:
        """By source file; "" is code without lines."""
        return self._summed(1)

    def _summed(self, part: int) -> Counter[str]:
        sums: Counter[str] = Counter()
        for place, cycles in self.places.items():
            sums[str(place[part])] += cycles
        return sums

    @property
    def busy(self) -> int:
        """Cycles in which the CPU worked."""
        return sum(self.places.values())

    @property
    def cycles(self) -> int:
        """All cycles."""
        return self.busy + self.idle

    def group(self, patterns: list[str]) -> int:
        """Cycles of code whose function or source file matches one of the patterns (`*`, `?`, `[...]`)."""
        return sum(cycles for place, cycles in self.places.items() if _matches(place, patterns))

    def matched(self, pattern: str) -> bool:
        """Whether a pattern fits anything that ran."""
        return any(_matches(place, [pattern]) for place in self.places)


def _matches(place: Place, patterns: list[str]) -> bool:
    return any(fnmatch(name, pattern) for name in place[:2] for pattern in patterns)


class Profiler:
    """Counts what `machine` does; its engine is to be jit or plain. `timed` also keeps what happened in order.

    Raises ValueError for another engine.
    """

    def __init__(self, machine: Machine, image: Image, timed: bool = False) -> None:
        from emu.dspic30f.jit.engine import JitEngine

        self._machine: Final = machine
        self._image: Final = image
        self._runner: Final = machine.runner
        self._native: Final = self._runner if isinstance(self._runner, JitEngine) else None
        self._timed: Final = timed
        self._tree: Final = CallGraph(machine.cycle, machine.pc, timed)
        self._accounting: Final = CycleAccounting(machine.core, self._tree.take)
        self._rows: Final[dict[int, int]] = {}
        self._inside: Final[dict[int, frozenset[str]]] = {}
        self._places: Final[dict[int, Place]] = {}
        self.hz: Final = machine.hz
        """Cycles in a second."""

    @cached_property
    def _inspector(self) -> Inspector:
        return Inspector(self._machine)

    def run(self, until: int, skip: int = 0) -> Profile:
        """Run to cycle `until`, and count from cycle `skip` on; ends earlier with whatever stops the machine."""
        machine, accounting, entry = self._machine, self._accounting, self._machine.pc
        close = self._open()
        try:
            stop = self._advance(skip) if skip > machine.cycle else None
            accounting.flush_log()
            accounting.clear()
            self._tree.clear(machine.cycle)
            profile = Profile(entry, machine.cycle)
            profile.stop = stop or self._advance(until)
        finally:
            close()
        self._read(profile)
        return profile

    @contextmanager
    def counting(self) -> Iterator[Profile]:
        """Count what is run inside the block; the profile is filled in at its end."""
        profile = Profile(self._machine.pc, self._machine.cycle)
        close = self._open()
        try:
            yield profile
        finally:
            close()
            self._read(profile)
            profile.idle = profile.end - profile.start - profile.busy  # a sleep may be passed over at once, unseen

    def _open(self) -> Callable[[], None]:
        if self._native is not None:
            return self._native.start_accounting(self._accounting, self.row_of)
        self._accounting.start()
        return self._accounting.stop

    def _advance(self, until: int) -> Stop | None:
        self._machine.events.kick()  # no cycle passes unseen
        return self._machine.advance(until)

    def _read(self, profile: Profile) -> None:
        profile.end = self._machine.cycle
        cells = self._accounting.cells
        profile.idle = self._accounting.idle
        for level, cycles in enumerate(cells.sum(axis=1).tolist()):
            if cycles:
                profile.levels[level] = cycles
        rows: Counter[int] = Counter()
        spent = cells.sum(axis=0)
        for word in np.flatnonzero(spent).tolist():
            rows[self.row_of(2 * word)] += int(spent[word])
        profile.addresses = dict(rows)
        for row, cycles in rows.items():
            profile.places[self.place(row)] += cycles
        profile.edges = self._tree.end(profile.end)
        if self._timed:
            profile.turns = self._tree.turns()

    def row_of(self, pc: int) -> int:
        """First address of the stretch of code around `pc` that has one function and one line."""
        row = self._rows.get(pc)
        if row is None:
            line, symbol = self._image.lines.find(pc), self._image.symbols.code(pc)
            starts = [line.start] if line is not None else []
            if symbol is not None:
                starts.append(symbol[0].address)
            row = self._rows[pc] = max(starts, default=pc)
        return row

    def inside(self, pc: int) -> frozenset[str]:
        """The functions around an instruction, inlined ones too, as the debug information has them."""
        known = self._inside.get(pc)
        if known is None:
            function = self._inspector.debug.function(pc)
            scopes = function.chain(pc) if function is not None else []
            known = self._inside[pc] = frozenset(scope.name for scope in scopes if scope.kind != "block")
        return known

    def place(self, pc: int) -> Place:
        """Function, file and line of an instruction."""
        known = self._places.get(pc)
        if known is None:
            line, name = self._image.lines.find(pc), self._image.symbols.text(pc).split("+")[0]
            known = self._places[pc] = (name, line.file, line.line) if line is not None else (name, "", 0)
        return known
