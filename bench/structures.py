"""How long the kernel's lists are in a running machine, and how deep its heap's tree: the limits bounds are given."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import emu

BUCKETS = 8
MOST = 200
"""Members of a list that is followed: more are none."""
NEXT_EVENT, SUBSCRIBERS, SIDES, HOLE_SIZE = 2, 4, (0, 2), 4
"""Where links stand in event and hole, and a hole's size (kernel.h, memory.c)."""
HEAP_STEP = 2
"""Bytes (kernel.h)."""


@dataclass
class Structures:
    """The most there was of everything when `look` was called.

    m events, b events of one bucket, s subscriptions of one event, t of all, q queued messages, h holes on a
    path of the tree (bounds --help).
    """

    machine: emu.Machine
    most: dict[str, int] = field(default_factory=lambda: dict.fromkeys("mbstqh", 0))

    def look(self) -> None:
        """Count everything, unless some list is being changed: an ISR's call comes there, too."""
        try:
            found = self._found()
        except _Torn:
            return
        for name, number in found.items():
            self.most[name] = max(self.most[name], number)

    def _found(self) -> dict[str, int]:
        buckets = [list(self._list(self._at("_events") + 2 * k, NEXT_EVENT)) for k in range(BUCKETS)]
        subscriptions = [sum(1 for _ in self._list(event + SUBSCRIBERS, 0)) for events in buckets for event in events]
        return {
            "m": sum(map(len, buckets)),
            "b": max(map(len, buckets)),
            "s": max(subscriptions, default=0),
            "t": sum(subscriptions),
            "q": sum(1 for name in ("_event_queue", "_undelivered") for _ in self._list(self._at(name), 0)),
            "h": self._depth(self.machine.peek("_holes")),
        }

    def _at(self, name: str) -> int:
        assert self.machine.image is not None
        symbol = self.machine.image.symbols.find(name)
        assert symbol is not None, name
        return symbol.address

    def _word(self, address: int) -> int:
        try:
            return self.machine.peek(address)
        except ValueError:  # no address of anything
            raise _Torn from None

    def _list(self, link: int, step: int) -> Iterator[int]:
        """Addresses of the members of a list, from the word that points to its first."""
        for _ in range(MOST):
            member = self._word(link)
            if not member:
                return
            yield member
            link = member + step
        raise _Torn

    def _depth(self, hole: int) -> int:
        if hole == self._at("_no_hole"):
            return 0
        size = self._word(hole + HOLE_SIZE)
        if size < HOLE_SIZE + 2 or self._word(hole + size - HEAP_STEP) != size:  # a hole has its size at its end, too
            raise _Torn
        return 1 + max(self._depth(self._word(hole + side)) for side in SIDES)


class _Torn(Exception):
    """Something is being changed."""
