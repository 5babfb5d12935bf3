"""Observer lists: callbacks that can be added and removed.

Board parts are always called. Tools are not called while recorded cycles are replayed (`Events.quiet`), because they
have already been called for them. A *lazy* listener only collects: its calls may come later, in order.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Generic, ParamSpec

from emu.system.events import Events

What = ParamSpec("What")


def _ignore(_urgent: bool) -> None:
    """Ignore whether any listener is eager."""


class Listeners(Generic[What]):
    """List of listeners. Calling it calls all of them, in the order of `add`."""

    def __init__(self, events: Events, urgency: Callable[[bool], object] = _ignore) -> None:
        """`urgency(urgent)` is called with the value of `self.urgent` after each change."""
        self._events: Final = events
        self._urgency: Final = urgency
        self._urgent = 0
        self._all: tuple[Callable[What, object], ...] = ()
        self._parts: tuple[Callable[What, object], ...] = ()
        self._assigned: Callable[What, object] | None = None

    def __call__(self, *what: What.args, **more: What.kwargs) -> None:
        for listener in self._parts if self._events.quiet else self._all:
            listener(*what, **more)

    @property
    def urgent(self) -> bool:
        """Return whether any listener is eager, that is, must be called immediately."""
        return self._urgent > 0

    def _count(self, change: int) -> None:
        self._urgent += change
        self._urgency(self._urgent > 0)

    def add(self, listener: Callable[What, object], *, part: bool = False, lazy: bool = False) -> Callable[[], None]:
        """Add a listener and return a function that removes it. During replay, only a `part` of the board is called."""
        self._count(not lazy)
        self._all = (*self._all, listener)
        if part:
            self._parts = (*self._parts, listener)
        removed = False

        def remove() -> None:
            nonlocal removed
            if not removed:
                removed = True
                self._count(-(not lazy))
                self._all = _without(self._all, listener)
                self._parts = _without(self._parts, listener) if part else self._parts

        return remove

    @property
    def assigned(self) -> Callable[What, object] | None:
        """Return the listener set by assignment. A new assignment replaces it; listeners added by `add` remain."""
        return self._assigned

    @assigned.setter
    def assigned(self, listener: Callable[What, object] | None) -> None:
        if self._assigned is not None:
            self._all = _without(self._all, self._assigned)
            self._count(-1)
        self._assigned = listener
        if listener is not None:
            self._all = (*self._all, listener)
            self._count(1)


def _without(
    listeners: tuple[Callable[What, object], ...], one: Callable[What, object]
) -> tuple[Callable[What, object], ...]:
    """Return the listeners without the first one that equals `one`."""
    index = listeners.index(one)
    return listeners[:index] + listeners[index + 1 :]
