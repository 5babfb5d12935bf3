"""Going back with what is around the machine: a trial of which it is one robot.

The machine finds the time by itself, in its own past; then the world is brought there (`Around.anew`) and the session
goes on with it: in a copy of this process that was kept before, to which it leaves what it knows, or here.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, NamedTuple

from emu.dap.breakpoint_requests import Stopping
from emu.dap.breakpoints import Breakpoint
from emu.dap.changes import Change
from emu.dap.debuggee import Debuggee, Halt
from emu.dap.state_requests import Refused
from emu.debug.history import History

if TYPE_CHECKING:
    from emu.dap.wire import Message
    from emu.machine.machine import Machine

HERE: Final = Halt("goto")
"""Where it stands already."""
INTERRUPTED: Final = Halt("pause", "on the way back")


class Left(NamedTuple):
    """What a session leaves to a copy of its process that is to go on from an earlier moment."""

    cycle: int
    """To which it goes, and ..."""
    halt: Halt
    """... what is told of it there."""
    changes: list[tuple[int, Change]]
    breakpoints: dict[str, list[Breakpoint]]
    stops_at_faults: bool
    last_id: int
    last_reference: int
    waiting: list[Message]
    ends_all: bool


class Returning(Stopping):
    """Brings the world to where the machine stands. `_record` makes the recording by which that goes back."""

    _record: Callable[[Machine], History]
    _waiting: list[Message]
    ends_all: bool
    _over: bool
    _pause: bool
    _said: dict[int, bytearray]

    def __init__(self) -> None:
        self._changes: list[tuple[int, Change]] = []
        """What was changed, and in which cycle."""
        self._is_muted = False
        """What the firmware says on the way was said before."""

    @abstractmethod
    def _wanted(self) -> bool:
        """Whether the client wants the machine to stand."""

    @abstractmethod
    def _say(self, text: str, category: str = "console") -> None:
        """Tell the user something."""

    @abstractmethod
    def _listen(self, machine: Machine) -> None:
        """Hear what the firmware says from now on."""

    @abstractmethod
    def _stopped(self, halt: Halt) -> None:
        """Tell where the machine stands."""

    def _pass_by(self) -> None:
        """Let a moment be kept, if the machine stands in its present. Raises WokenError in the copy."""
        history = self._target.history if self._target is not None else None
        if history is not None and history.around is not None and not history.is_past:
            history.around.pass_by()

    def _followed(self, halt: Halt) -> Halt:
        """The machine has gone somewhere; so does the world if moments of it are kept. What is to be told."""
        history = self._debuggee.history
        follows = history.around is not None and history.around.keeps_moments and history.is_past
        return self._brought(halt) if follows else halt

    def _bring(self) -> None:
        """As `Looking._bring`."""
        history = self._debuggee.history
        if history.around is None or not history.is_past:
            return
        halt = self._brought(HERE)
        if halt is not HERE:
            self._go(lambda: halt)
            raise Refused(f"interrupted on the way back, at cycle {self._debuggee.machine.cycle:,}")

    def _brought(self, halt: Halt) -> Halt:
        """The world to where the machine stands now, in its past; `halt`, or where it was interrupted on the way."""
        target, around = self._debuggee, self._debuggee.history.around
        assert around is not None
        cycle = target.machine.cycle
        changes = [one for one in self._changes if one[0] <= cycle]
        left = Left(cycle, halt, changes, target.breakpoints, target.stops_at_faults, self._last_id,
                    self._sights.last, self._waiting, self.ends_all)  # fmt: skip
        self._pause = False
        machine = around.anew(cycle, left)
        self._say(f"the trial is run again up to cycle {cycle:,}\n")
        fresh = Debuggee(machine, self._wanted, self._say, self._record(machine))
        self._target, self._sights.inspector = fresh, fresh.inspector
        self._listen(machine)
        is_there = self._arrived(cycle, [], changes)
        fresh.stop_at(target.breakpoints, target.stops_at_faults)
        return halt if is_there else INTERRUPTED

    def _take_over(self, left: Left) -> None:
        """Go on, in a copy of the process that was woken, in place of that from which it was."""
        target = self._debuggee
        target.stop_at({}, left.stops_at_faults)
        self._last_id, self._sights.last = left.last_id, left.last_reference
        self._waiting, self.ends_all, self._pause = left.waiting, left.ends_all, False
        self._sights.forget()
        self._said.clear()
        is_there = self._arrived(left.cycle, self._changes, left.changes)
        target.stop_at(left.breakpoints, left.stops_at_faults)
        if not self._over:
            self._stopped(left.halt if is_there else INTERRUPTED)

    def _arrived(self, cycle: int, done: list[tuple[int, Change]], changes: list[tuple[int, Change]]) -> bool:
        """Run on to a cycle, no breakpoint asked, and change again what was changed, `done` is already; whether it got
        there."""
        target = self._debuggee
        self._changes, self._is_muted = list(done), True
        try:
            for at, change in changes[len(done) :]:
                if not self._goes_to(at, target):
                    return False
                change.do(target.inspector)
                self._changes.append((at, change))
            return self._goes_to(cycle, target)
        finally:
            self._is_muted = False

    def _goes_to(self, cycle: int, target: Debuggee) -> bool:
        around = target.history.around
        if around is not None and around.keeps_moments:
            return target.arrive(cycle, lambda: around.pass_by(cycle))
        return target.arrive(cycle)

    def _change(self, change: Change) -> None:
        """As `Looking._change`."""
        frozen = self._debuggee.history.frozen
        if frozen:
            raise Refused(frozen)
        self._bring()
        change.do(self._debuggee.inspector)
        if self._debuggee.history.around is not None:
            self._changes.append((self._debuggee.machine.cycle, change))
