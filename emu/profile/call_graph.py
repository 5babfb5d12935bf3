"""Call graph of a run, across interrupts and threads; call_graph.c computes it.

Input: records of the cycle accounting. Output: one `CallEdge` per call site and callee, and optionally all `CallEvent`s
in order.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from emu.native_library import ADDRESS, INT, functions

OPEN, CLOSE, SWITCH, SLEEP = range(1, 5)
"""Kinds of call events: entry to a function or handler, its end, a change of stack, the end of a sleep."""
NOWHERE: Final = 0xFFFFFF
"""Call site for handlers and for a stack's first function, which no instruction calls."""
_EDGE_WORDS, _MOST_EDGES, _STACKS = 6, 1 << 16, 128
_EVENT_TYPE: Final = np.dtype([
    ("cycle", "<u8"), ("since", "<u8"), ("what", "<u4"), ("stack", "<u4"), ("raised", "<u4"), ("entry", "<u4"),
    ("site", "<u4"), ("length", "<u4"),
])  # fmt: skip


@cache
def _code() -> dict[str, Callable[..., int]]:
    return functions(Path(__file__).with_name("call_graph.c"), {
        "call_graph_size": (INT, ()),
        "call_graph_begin": (None, (ADDRESS, INT, INT, INT)),
        "call_graph_clear": (None, (ADDRESS, INT)),
        "call_graph_end": (None, (ADDRESS, INT)),
        "call_graph_open": (INT, (ADDRESS,)),
        "call_graph_process": (INT, (ADDRESS, ADDRESS, INT, ADDRESS)),
        "call_graph_edges": (INT, (ADDRESS, ADDRESS)),
        "call_graph_lost": (INT, (ADDRESS,)),
    })  # fmt: skip


@dataclass(frozen=True, slots=True)
class CallEdge:
    """Calls from one call site to one function. Handlers and a stack's first function have no call site."""

    site: int | None
    """Program address of the call instruction; None for handlers and a stack's first function."""
    entry: int
    calls: int
    cycles: int
    """Inclusive Tcy from entry to return, without interrupts, sleep, other threads and the loop around `idle`."""
    most: int
    """Cycles of the longest call, without recursive calls."""
    least: int


class CallEvent(NamedTuple):
    """A call event at `cycle`. It is a named tuple, whose construction takes half the time of a dataclass's."""

    cycle: int
    since: int
    """Cycle in which the handler's interrupt was requested."""
    what: int
    """Kind of event: OPEN, CLOSE, SWITCH or SLEEP."""
    stack: int
    """Number of the current stack."""
    raised: int
    """1 + CPU priority of a handler; 0 for a called function."""
    entry: int
    site: int
    """Program address of the call, or of the interrupted instruction."""
    length: int
    """Length in Tcy of a sleep that ends at `cycle`."""


class CallGraph:
    """Builds the call graph from accounting records. The program is at `entry` at `cycle`. `timed` keeps the events.

    `idle` is the entry of the function in which a scheduler waits; its caller is not charged for the waiting loop.
    """

    def __init__(self, cycle: int, entry: int, timed: bool = False, idle: int = NOWHERE) -> None:
        self._code: Final = _code()
        self._memory: Final[Any] = ctypes.create_string_buffer(self._code["call_graph_size"]())
        self._at: Final = ctypes.addressof(self._memory)
        self._parts: Final[list[Any]] = []
        self._room = np.empty(0, dtype=_EVENT_TYPE)
        """Reused buffer for events; allocating one for each call would take longer than filling it."""
        self._timed: Final = timed
        self._code["call_graph_begin"](self._at, cycle, entry, idle)

    def process(self, records: int, count: int) -> None:
        """Process `count` records at the host address `records`."""
        if not self._timed:
            self._code["call_graph_process"](self._at, records, count, None)
            return
        most = 2 * count + self._code["call_graph_open"](self._at) + _STACKS
        if len(self._room) < most:
            self._room = np.empty(most, dtype=_EVENT_TYPE)
        made = self._code["call_graph_process"](self._at, records, count, int(self._room.ctypes.data))
        self._parts.append(self._room[:made].copy())

    def clear(self, cycle: int) -> None:
        """Restart counting at `cycle`, with the current stacks."""
        self._code["call_graph_clear"](self._at, cycle)

    def end(self, cycle: int) -> list[CallEdge]:
        """End the run at `cycle` and return all edges. Raises OverflowError if a table of call_graph.c is full."""
        self._code["call_graph_end"](self._at, cycle)
        if self._code["call_graph_lost"](self._at):
            raise OverflowError(f"more than {_MOST_EDGES - 1} call edges, or calls nested deeper than the tables allow")
        room = np.zeros((_MOST_EDGES, _EDGE_WORDS), dtype=np.uint64)
        made = self._code["call_graph_edges"](self._at, int(room.ctypes.data))
        rows: list[list[int]] = room[:made].tolist()
        return [CallEdge(None if site == NOWHERE else site, *rest) for site, *rest in sorted(rows)]

    def events(self) -> Iterator[CallEvent]:
        """Yield the call events in order. Adjacent parts of a sleep, which engines divide differently, are one."""
        slept: CallEvent | None = None
        for part in self._parts:
            for event in map(CallEvent._make, part.tolist()):
                if slept is not None and event.what == SLEEP and event.cycle - event.length == slept.cycle:
                    slept = event._replace(length=slept.length + event.length)
                    continue
                if slept is not None:
                    yield slept
                slept = event if event.what == SLEEP else None
                if slept is None:
                    yield event
        if slept is not None:
            yield slept
