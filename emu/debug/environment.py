"""What lives around a machine that is debugged, and can be brought back: the trial that a robot is part of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from emu.machine.machine import Machine


class WokenError(Exception):
    """In a copy of a process, kept at an earlier moment: it goes on in place of the one that has left it `left`."""

    def __init__(self, left: Any) -> None:
        super().__init__("woken")
        self.left = left


class Around(Protocol):
    """A world that goes on with the machine, never without it, and is the same every time it is begun."""

    @property
    def keeps_moments(self) -> bool:
        """Whether it comes back from moments that are kept, so that it can follow every step back; otherwise it is
        begun anew each time, which takes as long as it took to get there."""

    def seen(self) -> list[tuple[str, str]]:
        """What there is to see in it now: names and values. The last is a digest of everything that lives in it."""

    def anew(self, cycle: int, left: Any) -> Machine:
        """Go back, so that `cycle` of the machine is yet to come. Either a copy of this process goes on, with what is
        `left` to it, from the latest moment before, and this never comes back; or all begins again from its start, and
        this is the machine that stands there now in place of the one before."""

    def pass_by(self, near: int | None = None) -> None:
        """The machine stands in its present, and a moment may be kept here: if one is due, or if the last is far from
        `near`, a cycle to which it is about to go. Raises WokenError in the copy when that is to go on."""
