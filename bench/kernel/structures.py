"""Measure lengths of kernel lists and the depth of the heap's tree in a running machine, as limits for bounds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import emu

BUCKETS = 8
MOST = 200
"""Maximum length of a list; a longer list is considered inconsistent."""
NEXT_EVENT, SUBSCRIBERS, OWNER, NEXT_THREAD, SIDES, HOLE_SIZE = 2, 4, 6, 14, (0, 2), 4
"""Offsets of the links in an event, thread and hole, of the PID in a subscription, and of a hole's size (kernel.h,
memory.c)."""
HEAP_STEP = 2
"""Granularity of the heap in bytes (kernel.h)."""


@dataclass
class Structures:
    """Sizes of the kernel's structures.

    n: threads; m: events; b: events of one bucket; s: subscriptions of one event; o: subscriptions of one thread;
    t: all subscriptions; q: queued messages; h: holes on a path of the tree (bounds --help).
    """

    machine: emu.Machine

    def sizes(self) -> dict[str, int]:
        """Return all sizes, or an empty dictionary if a list is being changed, because an ISR may make the measured
        call during a change."""
        try:
            return self._found()
        except _InconsistentError:
            return {}

    def _found(self) -> dict[str, int]:
        buckets = [list(self._list(self._at("_events") + 2 * k, NEXT_EVENT)) for k in range(BUCKETS)]
        subscriptions = [list(self._list(event + SUBSCRIBERS, 0)) for events in buckets for event in events]
        owners = Counter(self._word(one + OWNER) for those in subscriptions for one in those)
        return {
            "n": len(self._ring(self._word(self._at("_os_ring"))))
            + len(list(self._list(self._at("_os_blocked"), NEXT_THREAD))),
            "m": sum(map(len, buckets)),
            "b": max(map(len, buckets)),
            "s": max(map(len, subscriptions), default=0),
            "o": max(owners.values(), default=0),
            "t": owners.total(),
            "q": sum(1 for name in ("_event_queue", "_delivery_batch") for _ in self._list(self._at(name), 0)),
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
        except ValueError:  # not a valid address
            raise _InconsistentError from None

    def _list(self, link: int, step: int) -> Iterator[int]:
        """Yield the addresses of a list's members.

        `link`: address of the pointer to the first member; `step`: offset in a member of the pointer to the next one.
        """
        for _ in range(MOST):
            member = self._word(link)
            if not member:
                return
            yield member
            link = member + step
        raise _InconsistentError

    def _ring(self, first: int) -> set[int]:
        """Return the addresses of the threads in a ring, such as that of the ready threads."""
        found: set[int] = set()
        while first and first not in found:
            found.add(first)
            first = self._word(first + NEXT_THREAD)
        return found

    def _depth(self, hole: int) -> int:
        if hole == self._at("_no_hole"):
            return 0
        size = self._word(hole + HOLE_SIZE)
        if size < HOLE_SIZE + 2 or self._word(hole + size - HEAP_STEP) != size:  # a hole repeats its size at its end
            raise _InconsistentError
        return 1 + max(self._depth(self._word(hole + side)) for side in SIDES)


class _InconsistentError(Exception):
    """A structure is being changed, so its links are inconsistent."""
