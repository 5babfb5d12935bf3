"""Event schedule: fixed slots of due cycles in the state record (engines.md §4.2). It is a machine's only clock.

Time is one integer: Tcy since power-on. A slot serves one purpose of one device. Slots are numbered in the order of
their construction, and the number breaks ties. There is no heap and no serial number, so a copy of the record is a copy
of the schedule.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from emu.system.record import Record

NEVER: Final = 0xFFFF_FFFF_FFFF_FFFF
"""Due cycle of an idle slot: it is later than every cycle."""

SLOTS: Final = 96


class Events:
    """Event schedule of a machine. `deadline` is the earliest cycle at which an engine must handle a boundary.

    The engine sets `now` to the cycle of its current access, so that hooks need no time argument.
    """

    def __init__(self, record: Record) -> None:
        self._u64 = record.u64
        self.now_index: Final = record.reserve("events.now", "Q").index
        self.deadline_index: Final = record.reserve("events.deadline", "Q").index
        self._now: Final = self.now_index
        self._deadline: Final = self.deadline_index
        self._first = record.reserve("events.due", "Q", SLOTS).index
        self.firing = False
        """Whether an event is being handled; False during an instruction's access or a tool's call."""
        self.quiet = False
        """Whether recorded cycles are replayed; their observers have already been called and are not called again."""
        self.is_peeking = False
        """Whether a tool looks at a value. Parts then compute it without a change of their state."""
        self.names: Final[list[str]] = []
        self._fire: Final[list[Callable[[int], None]]] = []
        self.rules: Final[dict[int, Any]] = {}
        """Rules of events, by slot (emu/system/rules.py)."""
        self._due = record.u64[self._first : self._first + SLOTS]
        for slot in range(SLOTS):
            self._due[slot] = NEVER
        self._u64[self._deadline] = NEVER

    @property
    def now(self) -> int:
        """Return the cycle of the access or event that is being handled, in Tcy."""
        return self._u64[self._now]

    @now.setter
    def now(self, cycle: int) -> None:
        self._u64[self._now] = cycle

    def peek(self, compute: Callable[[], int]) -> int:
        """Return the value that `compute` returns for a tool."""
        before, self.is_peeking = self.is_peeking, True
        try:
            return compute()
        finally:
            self.is_peeking = before

    @property
    def deadline(self) -> int:
        """Return the earliest cycle with work: the minimum over the slots, or 0 after `kick`."""
        return self._u64[self._deadline]

    def slot(self, name: str, fire: Callable[[int], None]) -> int:
        """Allocate the next slot. `fire(due)` receives the posted cycle, so that periods cannot drift."""
        if len(self.names) == SLOTS:
            raise ValueError(f"no event slot left for {name!r}")
        self.names.append(name)
        self._fire.append(fire)
        return len(self.names) - 1

    def set_rule(self, slot: int, rule: Any, runs: Callable[[Any], bool]) -> None:
        """Handle the events of a slot by `rule`.

        `runs(rule)` returns False if the slot's own function must handle one.
        """
        fire = self._fire[slot]
        self.rules[slot] = rule
        self._fire[slot] = lambda due: None if runs(rule) else fire(due)

    def set(self, slot: int, due: int) -> None:
        """Post `slot` for the cycle `due`, replacing an earlier posting."""
        self._due[slot] = due
        if due < self._u64[self._deadline]:
            self._u64[self._deadline] = due

    def cancel(self, slot: int) -> None:
        """Make `slot` idle. The deadline may remain too early, which costs one unnecessary check."""
        self._due[slot] = NEVER

    def due(self, slot: int) -> int:
        """Return the cycle for which `slot` is posted, or NEVER."""
        return self._due[slot]

    def next_due(self) -> int:
        """Return the earliest due cycle of all slots; NEVER if all are idle."""
        return min(self._due[: len(self._fire)].tolist(), default=NEVER)

    def kick(self) -> None:
        """Make the engine check for interrupts at the next boundary, because a flag, enable or priority has changed."""
        self._u64[self._deadline] = 0

    def fire_until(self, cycle: int) -> None:
        """Fire all events due at or before `cycle`, sorted by (due, slot). An earlier `kick` stays in effect."""
        first = self._fire_until(cycle)
        if self._u64[self._deadline]:
            self._u64[self._deadline] = first

    def settle(self, cycle: int) -> None:
        """Fire events as `fire_until` does, and clear a `kick`: the deadline becomes the earliest due cycle."""
        self._u64[self._deadline] = self._fire_until(cycle)

    def arrive(self, cycle: int) -> None:
        """Advance the devices to an access in `cycle`: fire the events due by then and set `now`."""
        if self._u64[self._deadline] <= cycle:
            self.fire_until(cycle)
        self._u64[self._now] = cycle

    def _fire_until(self, cycle: int) -> int:
        due = self._due
        count = len(self._fire)
        self.firing = True
        try:
            while True:
                pending = due[:count].tolist()
                first = min(pending, default=NEVER)
                if first > cycle:
                    return first
                slot = pending.index(first)
                due[slot] = NEVER
                self.now = first
                self._fire[slot](first)
        finally:
            self.firing = False
