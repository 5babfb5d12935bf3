"""Interfaces through which a controller runs its machine or crowd; a debugger supplies its own implementations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from emu.machine.stops import Stop


class RobotControl(Protocol):
    """Runs the machine of one robot over the ends of quanta. `Machine` itself is the default implementation.

    The methods have the contract of the methods of `Machine` with the same names. An implementation may suspend the
    calling greenlet, and with it the whole trial, at any instruction.
    """

    def run_past(self, first: int, period: int, last: int, cuts: list[int]) -> Stop | None:
        """Run to cycle `last`; append to `cuts` the cycle at which each quantum ended. Return why it stopped early."""

    def end_at_cut(self) -> None:
        """Make the current `run_past` end at the next end of a quantum."""

    def cuts_so_far(self) -> list[int]:
        """Return the ends of quanta that the current `run_past` has reached."""


class CrowdControl(Protocol):
    """Runs all Kilobots of a trial."""

    def run_crowd(self, end: int) -> None:
        """Run all robots to tick `end` (125 ns each). May suspend the greenlet, and with it the trial, at any time."""
