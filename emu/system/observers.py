"""Who is told when something happens: any number of listeners, each of which can be removed.

Parts of a board always hear. People and tools do not while a stretch of time that has been told is run again
(`Events.quiet`): they heard it the first time. Who only collects is *lazy*: it may hear some time later, in order.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Generic, ParamSpec

from emu.system.events import Events

What = ParamSpec("What")


def _nobody(_urgent: bool) -> None:
    """Nobody asks whether listeners are lazy."""


class Listeners(Generic[What]):
    """Call it to tell everyone, in the order of `add`."""

    def __init__(self, events: Events, urgency: Callable[[bool], object] = _nobody) -> None:
        """urgency(urgent): called when a listener has come or gone, with whether one of all must hear at once."""
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
        """Whether some of them must hear at once."""
        return self._urgent > 0

    def _count(self, change: int) -> None:
        self._urgent += change
        self._urgency(self._urgent > 0)

    def add(self, listener: Callable[What, object], *, part: bool = False, lazy: bool = False) -> Callable[[], None]:
        """Tell `listener` from now on; a `part` of the board hears even what is run again. Returns how to remove it."""
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
        """The one listener that an assignment replaces; those of `add` stay."""
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
    """The first of what equals `one` left out."""
    place = listeners.index(one)
    return listeners[:place] + listeners[place + 1 :]
