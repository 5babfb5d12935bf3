"""Exact cycle counts by instruction, function, interrupt level and Idle, together with the call graph.

Input: a machine with its image. Output: a `Profile`, whose numbers add up to the total of cycles. Exception entry (the
forced NOPs and pushes, isa.md §14.2) counts for the handler, at its level.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from fnmatch import fnmatch
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np

from emu.debug.inspector import Inspector
from emu.dspic30f.cycle_accounting import CycleAccounting
from emu.host.result_tables import data_frame, html_table
from emu.image.model import Image
from emu.profile.call_graph import NOWHERE, CallEdge, CallEvent, CallGraph

if TYPE_CHECKING:
    from emu.image.lines import LineTable
    from emu.image.symbols import Symbols
    from emu.machine.machine import Machine
    from emu.machine.stops import Stop

IDLE_FUNCTION: Final = "hal_idle"
"""Function in which the scheduler of OpenSwarm waits (firmware/openswarm/port/dspic30f/switch.S)."""
CodeLocation = tuple[str, str, int]
"""(function, source file, line) of code; "" and 0 for code without line information."""


class CodeImage(Protocol):
    """An image with symbols and source lines by program address."""

    @property
    def symbols(self) -> Symbols: ...
    @property
    def lines(self) -> LineTable: ...


@dataclass(slots=True)
class Profile:
    """Cycles of a run by address, function, line and priority; call graph."""

    entry: int = 0
    """Program address at the start of the profile."""
    start: int = 0
    """First cycle that the profile counts."""
    end: int = 0
    idle: int = 0
    """Number of cycles in Idle or Sleep."""
    addresses: dict[int, int] = field(default_factory=dict)
    """Cycles by the first program address of a source line's code range."""
    locations: Counter[CodeLocation] = field(default_factory=Counter)
    """Cycles by function, source file and line; inlined code keeps its file."""
    levels: Counter[int] = field(default_factory=Counter)
    """Cycles by CPU priority: 0 to 7, traps 8 and above."""
    edges: list[CallEdge] = field(default_factory=list)
    """Call graph: call sites, callees, numbers and cycles of calls."""
    events: Iterable[CallEvent] = ()
    """Call events in order, if `timed`. The iterable can be consumed only once."""
    stop: Stop | None = None
    """Stop that ended the run early; None if there was none."""

    def __repr__(self) -> str:
        return f"<Profile: {self.cycles:,} cycles, {self.idle:,} idle, {len(self.functions)} functions>"

    def rows(self) -> list[dict[str, object]]:
        """Return one row per function: name, exclusive cycles and share in percent, the largest first."""
        whole = max(self.cycles, 1)
        return [
            {"function": name, "cycles": cycles, "percent": 100 * cycles / whole}
            for name, cycles in self.functions.most_common()
        ]

    def frame(self) -> Any:
        """Return `rows` as a pandas DataFrame. Raises ModuleNotFoundError without pandas."""
        return data_frame(self.rows())

    def _repr_html_(self) -> str:
        return html_table(self.rows(), repr(self)[1:-1])

    @property
    def functions(self) -> Counter[str]:
        """Exclusive cycles by function."""
        return self._summed(0)

    @property
    def lines(self) -> Counter[str]:
        """Cycles by source line, as text `file:line`; code without line information is omitted."""
        sums: Counter[str] = Counter()
        for (_, file, line), cycles in self.locations.items():
            if file:
                sums[f"{file}:{line}"] += cycles
        return sums

    @property
    def files(self) -> Counter[str]:
        """Cycles by source file; "" stands for code without line information."""
        return self._summed(1)

    def _summed(self, part: int) -> Counter[str]:
        sums: Counter[str] = Counter()
        for place, cycles in self.locations.items():
            sums[str(place[part])] += cycles
        return sums

    @property
    def busy(self) -> int:
        """Cycles in which the CPU executed instructions."""
        return sum(self.locations.values())

    @property
    def cycles(self) -> int:
        """Total number of cycles."""
        return self.busy + self.idle

    def group(self, patterns: list[str]) -> int:
        """Return the cycles of code whose function or source file matches one of the patterns (`*`, `?`, `[...]`)."""
        return sum(cycles for place, cycles in self.locations.items() if _matches(place, patterns))

    def matched(self, pattern: str) -> bool:
        """Return whether a pattern matches any executed code."""
        return any(_matches(place, [pattern]) for place in self.locations)


def _matches(place: CodeLocation, patterns: list[str]) -> bool:
    return any(fnmatch(name, pattern) for name in place[:2] for pattern in patterns)


class CodeLocations:
    """Functions and source lines of an image's instructions."""

    def __init__(self, image: CodeImage) -> None:
        self._image: Final = image
        self._rows: Final[dict[int, int]] = {}
        self._locations: Final[dict[int, CodeLocation]] = {}

    def row_of(self, pc: int) -> int:
        """Return the first address of the code range that contains `pc` and has one function and line."""
        row = self._rows.get(pc)
        if row is None:
            line, symbol = self._image.lines.find(pc), self._image.symbols.code(pc)
            starts = [line.start] if line is not None else []
            if symbol is not None:
                starts.append(symbol[0].address)
            row = self._rows[pc] = max(starts, default=pc)
        return row

    def at(self, pc: int) -> CodeLocation:
        """Return function, file and line of an instruction."""
        known = self._locations.get(pc)
        if known is None:
            line, name = self._image.lines.find(pc), self._image.symbols.text(pc).split("+")[0]
            known = self._locations[pc] = (name, line.file, line.line) if line is not None else (name, "", 0)
        return known


class Profiler:
    """Profiler of `machine`, whose engine must be jit or plain. `timed` also keeps the call events.

    Raises ValueError for any other engine.
    """

    def __init__(self, machine: Machine, image: Image, timed: bool = False) -> None:
        from emu.dspic30f.jit.engine import JitEngine

        self._machine: Final = machine
        self._image: Final = image
        self._runner: Final = machine.runner
        self._native: Final = self._runner if isinstance(self._runner, JitEngine) else None
        self._timed: Final = timed
        idle = image.symbols.find(IDLE_FUNCTION)
        self._call_graph: Final = CallGraph(
            machine.cycle, machine.pc, timed, idle.address if idle is not None else NOWHERE
        )
        self._accounting: Final = CycleAccounting(machine.core, self._call_graph.process)
        self._code: Final = CodeLocations(image)
        self._inside: Final[dict[int, frozenset[str]]] = {}
        self.hz: Final = machine.hz
        """Cycles per second."""

    @cached_property
    def _inspector(self) -> Inspector:
        return Inspector(self._machine)

    def run(self, until: int, skip: int = 0) -> Profile:
        """Run to cycle `until` and count from cycle `skip` on. A stop of the machine ends the run early."""
        machine, accounting, entry = self._machine, self._accounting, self._machine.pc
        close = self._open()
        try:
            stop = self._advance(skip) if skip > machine.cycle else None
            accounting.flush_log()
            accounting.clear()
            self._call_graph.clear(machine.cycle)
            profile = Profile(entry, machine.cycle)
            profile.stop = stop or self._advance(until)
        finally:
            close()
        self._read(profile)
        return profile

    @contextmanager
    def counting(self) -> Iterator[Profile]:
        """Count the cycles that run inside the block. The profile is complete after the block."""
        profile = Profile(self._machine.pc, self._machine.cycle)
        close = self._open()
        try:
            yield profile
        finally:
            close()
            self._read(profile)
            profile.idle = profile.end - profile.start - profile.busy  # a step may skip a whole sleep without a record

    def _open(self) -> Callable[[], None]:
        if self._native is not None:
            from emu.dspic30f.jit.counting import CycleCounting

            return self._native.start_counting(CycleCounting(self._accounting, self._code.row_of))
        self._accounting.start()
        return self._accounting.stop

    def _advance(self, until: int) -> Stop | None:
        self._machine.events.kick()  # makes native code account for every cycle
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
            rows[self._code.row_of(2 * word)] += int(spent[word])
        profile.addresses = dict(rows)
        for row, cycles in rows.items():
            profile.locations[self.location(row)] += cycles
        profile.edges = self._call_graph.end(profile.end)
        if self._timed:
            profile.events = self._call_graph.events()

    def inside(self, pc: int) -> frozenset[str]:
        """Return the functions that contain an instruction, including inlined ones, from the debug information."""
        known = self._inside.get(pc)
        if known is None:
            function = self._inspector.debug.function(pc)
            scopes = function.chain(pc) if function is not None else []
            known = self._inside[pc] = frozenset(scope.name for scope in scopes if scope.kind != "block")
        return known

    def row_of(self, pc: int) -> int:
        """Return the first address of the code range that contains `pc` and has one function and line."""
        return self._code.row_of(pc)

    def location(self, pc: int) -> CodeLocation:
        """Return function, file and line of an instruction."""
        return self._code.at(pc)
