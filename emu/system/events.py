"""The only clock: fixed slots of due cycles in the state record (engines.md §4.2).

Time is one integer, Tcy since power-on. A slot belongs to one (device, purpose); its number, given in the order of
wiring, breaks ties. No heap and no serial numbers, so a copy of the record is a copy of the schedule.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from emu.system.record import Record

NEVER: Final = 0xFFFF_FFFF_FFFF_FFFF
"""Due cycle of an idle slot."""

SLOTS: Final = 96


class Events:
    """Schedule of a machine. `deadline` is the earliest cycle at which an engine must stop and look.

    The engine keeps `now` at the cycle of the access it is making, so hooks need no time argument.
    """

    def __init__(self, record: Record) -> None:
        self._u64 = record.u64
        self.now_index: Final = record.reserve("events.now", "Q").index
        self.deadline_index: Final = record.reserve("events.deadline", "Q").index
        self._now: Final = self.now_index
        self._deadline: Final = self.deadline_index
        self._first = record.reserve("events.due", "Q", SLOTS).index
        self.firing = False
        """An event is being handled, as opposed to an access of an instruction or a call from outside."""
        self.quiet = False
        """What happens has happened before and been told: nobody outside hears of it again."""
        self.names: Final[list[str]] = []
        self._fire: Final[list[Callable[[int], None]]] = []
        self.rules: Final[dict[int, Any]] = {}
        """By slot what firing does in the common case, as text for every engine (emu/system/rules.py)."""
        self._due = record.u64[self._first : self._first + SLOTS]
        for slot in range(SLOTS):
            self._due[slot] = NEVER
        self._u64[self._deadline] = NEVER

    @property
    def now(self) -> int:
        """Cycle of the access or event being handled, in Tcy."""
        return self._u64[self._now]

    @now.setter
    def now(self, cycle: int) -> None:
        self._u64[self._now] = cycle

    @property
    def deadline(self) -> int:
        """Earliest cycle with work to do: the minimum over the slots, or 0 after `kick`."""
        return self._u64[self._deadline]

    def slot(self, name: str, fire: Callable[[int], None]) -> int:
        """Claim the next slot. `fire(due)` gets the cycle it was due at, so periods cannot drift."""
        if len(self.names) == SLOTS:
            raise ValueError(f"no event slot left for {name!r}")
        self.names.append(name)
        self._fire.append(fire)
        return len(self.names) - 1

    def set_rule(self, slot: int, rule: Any, runs: Callable[[Any], bool]) -> None:
        """A slot follows `rule` where `runs(rule)` says that it did it all."""
        fire = self._fire[slot]
        self.rules[slot] = rule
        self._fire[slot] = lambda due: None if runs(rule) else fire(due)

    def set(self, slot: int, due: int) -> None:
        """Let `slot` fire at cycle `due` (replacing its earlier date)."""
        self._due[slot] = due
        if due < self._u64[self._deadline]:
            self._u64[self._deadline] = due

    def cancel(self, slot: int) -> None:
        """Make `slot` idle. The deadline may stay too early, which costs one empty look."""
        self._due[slot] = NEVER

    def due(self, slot: int) -> int:
        """Cycle `slot` is due at, or NEVER."""
        return self._due[slot]

    def next_due(self) -> int:
        """Earliest due cycle of all slots, NEVER if all are idle."""
        return min(self._due[: len(self._fire)].tolist(), default=NEVER)

    def kick(self) -> None:
        """Make the engine look at the next instruction boundary (an interrupt flag, enable or priority changed)."""
        self._u64[self._deadline] = 0

    def fire_until(self, cycle: int) -> None:
        """Fire everything due at or before `cycle`, in order of (due, slot). A kick stays in force."""
        first = self._fire_until(cycle)
        if self._u64[self._deadline]:
            self._u64[self._deadline] = first

    def settle(self, cycle: int) -> None:
        """As `fire_until`, and the engine has looked: the deadline becomes the earliest due cycle."""
        self._u64[self._deadline] = self._fire_until(cycle)

    def arrive(self, cycle: int) -> None:
        """Bring devices up to the accesses of `cycle`: what is due by then fires, `now` becomes `cycle`."""
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
