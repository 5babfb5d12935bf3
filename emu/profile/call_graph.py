"""Who called whom while a program ran, through interrupts and threads; the work is done by follow.c.

What enters: notes of a ledger. What leaves: `CallEdge`s, one for every place that called something, and if wanted
`CallEvent`s, everything that happened in order.
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
"""What a turn tells: a function or handler begins, ends; the program is on another stack; it has slept."""
NOWHERE: Final = 0xFFFFFF
"""Call site of what nobody called: handlers, and where a stack begins."""
_EDGE_WORDS, _MOST_EDGES, _STACKS = 6, 1 << 16, 128
_TURN: Final = np.dtype([
    ("cycle", "<u8"), ("since", "<u8"), ("what", "<u4"), ("stack", "<u4"), ("raised", "<u4"), ("entry", "<u4"),
    ("site", "<u4"), ("length", "<u4"),
])  # fmt: skip


@cache
def _code() -> dict[str, Callable[..., int]]:
    return functions(Path(__file__).with_name("call_graph.c"), {
        "tree_size": (INT, ()),
        "tree_begin": (None, (ADDRESS, INT, INT)),
        "tree_clear": (None, (ADDRESS, INT)),
        "tree_end": (None, (ADDRESS, INT)),
        "tree_open": (INT, (ADDRESS,)),
        "tree_follow": (INT, (ADDRESS, ADDRESS, INT, ADDRESS)),
        "tree_edges": (INT, (ADDRESS, ADDRESS)),
        "tree_lost": (INT, (ADDRESS,)),
    })  # fmt: skip


@dataclass(frozen=True, slots=True)
class CallEdge:
    """Calls from one place to one function. Handlers of interrupts, and where a stack begins, are called by nobody."""

    site: int | None
    """Program address of the call."""
    entry: int
    calls: int
    cycles: int
    """Tcy from entry to return, with all calls, without interrupts, sleep and other threads."""
    most: int
    """Those of the longest call, recursion left out."""
    least: int


class CallEvent(NamedTuple):
    """Something that happened in `cycle`. There are many: tuples are made at half the cost."""

    cycle: int
    since: int
    """Cycle in which the interrupt of a handler was requested."""
    what: int
    """OPEN, CLOSE, SWITCH or SLEEP."""
    stack: int
    """Number of the stack the program is on."""
    raised: int
    """1 + CPU priority of a handler; 0 for a called function."""
    entry: int
    site: int
    """Program address of a call, or of what an interrupt interrupted."""
    length: int
    """Tcy of a sleep that ends now."""


class CallGraph:
    """Follows the notes it is given, from a program that is at `entry` in `cycle`. `timed` keeps the turns."""

    def __init__(self, cycle: int, entry: int, timed: bool = False) -> None:
        self._code: Final = _code()
        self._memory: Final[Any] = ctypes.create_string_buffer(self._code["tree_size"]())
        self._at: Final = ctypes.addressof(self._memory)
        self._parts: Final[list[Any]] = []
        self._room = np.empty(0, dtype=_TURN)
        """Where turns are written, again and again: fresh memory would cost more than writing them."""
        self._timed: Final = timed
        self._code["tree_begin"](self._at, cycle, entry)

    def take(self, notes: int, count: int) -> None:
        """Follow `count` notes at the host address `notes`."""
        if not self._timed:
            self._code["tree_follow"](self._at, notes, count, None)
            return
        most = 2 * count + self._code["tree_open"](self._at) + _STACKS
        if len(self._room) < most:
            self._room = np.empty(most, dtype=_TURN)
        made = self._code["tree_follow"](self._at, notes, count, int(self._room.ctypes.data))
        self._parts.append(self._room[:made].copy())

    def clear(self, cycle: int) -> None:
        """Count from now on; who is where stays. The turns up to now are dropped but for what is still open."""
        self._code["tree_clear"](self._at, cycle)

    def end(self, cycle: int) -> list[CallEdge]:
        """The program ends in `cycle`: all edges. Raises OverflowError if there are more than can be followed."""
        self._code["tree_end"](self._at, cycle)
        if self._code["tree_lost"](self._at):
            raise OverflowError(f"more than {_MOST_EDGES - 1} call sites, or calls nested deeper than RAM is")
        room = np.zeros((_MOST_EDGES, _EDGE_WORDS), dtype=np.uint64)
        made = self._code["tree_edges"](self._at, int(room.ctypes.data))
        rows: list[list[int]] = room[:made].tolist()
        return [CallEdge(None if site == NOWHERE else site, *rest) for site, *rest in sorted(rows)]

    def turns(self) -> Iterator[CallEvent]:
        """What happened, in order."""
        for part in self._parts:
            yield from map(CallEvent._make, part.tolist())
