"""What lives around a machine that is debugged, and can be begun anew: the trial that a robot is part of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from emu.machine import Machine


class Around(Protocol):
    """A world that goes on with the machine, never without it, and is the same every time it is begun."""

    def seen(self) -> list[tuple[str, str]]:
        """What there is to see in it now: names and values. The last is a digest of everything that lives in it."""

    def anew(self) -> Machine:
        """Begin it again from its start; the machine that stands there now in place of the one before."""
