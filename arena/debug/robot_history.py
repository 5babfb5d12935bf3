"""Histories of a debugged robot: its machine alone replays the past; the present runs together with the world."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

from emu.debug.avr.history import KilobotHistory
from emu.debug.history import History, position
from emu.machine.stops import STILL_ASLEEP, Stop

if TYPE_CHECKING:
    from arena.debug.crowd_member import CrowdMember
    from emu.machine.machine import Machine

NO_LIMIT: Final = sys.maxsize
RunInTrial = Callable[[Callable[[int], Stop | None]], Stop | None]
"""run_in_trial(act): `ControlledRobot.run_in_trial`."""


class RobotHistory(History):
    """History of a robot of a trial. `read_only(is_past)` returns why the machine must not be changed, or nothing."""

    def __init__(self, machine: Machine, run_in_trial: RunInTrial, read_only: Callable[[bool], str]) -> None:
        super().__init__(machine)
        self._run_in_trial: Final = run_in_trial
        self._read_only: Final = read_only

    @property
    def read_only_reason(self) -> str:
        return self._read_only(self.is_past)

    def suspend(self) -> None:
        """Remember the state of the machine: the trial runs without the debugger until `resume`."""
        self._last_state = self.machine.snapshot()
        self.end = self.machine.cycle

    def resume(self) -> None:
        """Record what the trial has changed in the machine since `suspend`."""
        self._detect_change()

    def _advance_present(self, cycle: int) -> Stop | None:
        machine, stop = self.machine, None
        while stop is None and machine.cycle < cycle:
            stop = self._run_in_trial(lambda limit: machine.run_until(min(cycle, limit)))
        return stop


class EpuckRobotHistory(RobotHistory):
    """History of an e-puck."""

    def _step_present(self, limit: int) -> Stop | None:
        """Step once in the present. A sleep may continue over the ends of quanta, at most to cycle `limit`."""
        machine, stepped, last = self.machine, False, limit
        before = position(machine)

        def step(limit: int) -> Stop | None:
            nonlocal stepped
            limit = min(limit, last)
            stop = machine.service_boundary(limit)
            entered = stepped = position(machine) != before
            if entered or stop is not None or machine.cycle >= limit:
                return stop or machine.run_until(machine.cycle if entered else limit)
            stepped = True
            return machine.step(limit)

        stop = None
        while stop is None and not stepped and machine.cycle < last:
            stop = self._run_in_trial(step)
        if stop is None and not stepped:
            return Stop("limit", machine.pc, machine.cycle, STILL_ASLEEP)
        return stop

    @contextmanager
    def _replaying(self) -> Iterator[None]:
        self.machine.pins.flush()  # pending pin changes belong to the present and must be reported in it
        with self.machine.board.motors.history_paused(), super()._replaying():
            yield


class KilobotRobotHistory(RobotHistory, KilobotHistory):
    """History of a Kilobot in its crowd."""

    def __init__(
        self, machine: Machine, run_in_trial: RunInTrial, read_only: Callable[[bool], str], member: CrowdMember
    ) -> None:
        super().__init__(machine, run_in_trial, read_only)
        self._member: Final = member

    def _step_present(self, limit: int) -> Stop | None:
        """Step once in the present. A sleep may continue over the ends of quanta, at most to cycle `limit`."""
        machine = self.machine
        found: list[Stop | None] = []

        def step(_limit: int) -> Stop | None:
            stop = machine.step(limit)
            if stop is not None and stop.detail == STILL_ASLEEP and machine.cycle < limit:
                return None  # the quantum has ended before the step
            found.append(stop)
            return stop

        stop = None
        while stop is None and not found:
            stop = self._run_in_trial(step)
        return found[0] if found else stop

    @contextmanager
    def _replaying(self) -> Iterator[None]:
        before, self._member.is_past = self._member.is_past, True
        try:
            with super()._replaying():
                yield
        finally:
            self._member.is_past = before
