"""Debugger control of one robot of a trial: the whole world pauses with the robot, and the record is unaffected.

There are two greenlets: that of the trial, in which the robot runs, and that of the debugger. The machine runs forward
only in the trial's greenlet, at most to the next end of a quantum. All its inputs therefore come from the world.
Between two such runs, the debugger decides how far the machine may run.

The inputs of the robot are logged (`InputLog`). The debugger's greenlet can therefore run the past of the robot again
without the world, which stays in the present. If the user inspects the world of the past, or changes the past,
`ReplayRequired` aborts the trial. The trial then runs again from its seed to the cycle of the robot. The new robots
equal the old ones to the bit, and the debugger continues with them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

from greenlet import getcurrent, greenlet

from arena.debug.input_log import InputLog
from arena.robots.controller import Controller
from arena.robots.firmware_controller import FirmwareController
from arena.scene.robot_kind import EPUCK
from arena.trial.snapshot import state_view
from arena.world.physics import World
from emu.debug.history import History, position
from emu.machine.machine import Machine
from emu.machine.stops import STILL_ASLEEP, Stop

OVER: Final = "the trial is over"


class TrialAbortedError(Exception):
    """The debugger client has ended the trial before its end."""


class ReplayRequired(Exception):
    """The trial must run again from its seed, because the debugger has gone back to an earlier cycle."""


class RobotHistory(History):
    """History of a robot of a trial: the machine alone replays the past; the present runs together with the world."""

    def __init__(self, controlled: ControlledRobot, machine: Machine) -> None:
        super().__init__(machine)
        self._controlled: Final = controlled

    @property
    def read_only_reason(self) -> str:
        return self._controlled.read_only_reason

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
            stop = self._controlled.run_in_trial(lambda limit: machine.run_until(min(cycle, limit)))
        return stop

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
            stop = self._controlled.run_in_trial(step)
        if stop is None and not stepped:
            return Stop("limit", machine.pc, machine.cycle, STILL_ASLEEP)
        return stop

    @contextmanager
    def _replaying(self) -> Iterator[None]:
        self.machine.pins.flush()  # pending pin changes belong to the present and must be reported in it
        with self.machine.board.motors.history_paused(), super()._replaying():
            yield


class ControlledRobot:
    """Robot number `robot` of a trial, controlled by `debugger`; the `RobotControl` of its firmware controller.

    `debugger` is called in a greenlet of its own when the robot is switched on. It creates a history with `record`. If
    it returns true, the trial continues without it; if it returns false, `TrialAbortedError` ends the trial. With
    `is_recorded` the trial is recorded, and the debugger must not change it.

    The runner of the trial calls `attach` with world and robots first. When the trial ends in `ReplayRequired`, the
    runner starts it again.
    """

    def __init__(self, robot: int, debugger: Callable[[ControlledRobot], bool], is_recorded: bool) -> None:
        self.is_recorded: Final = is_recorded
        self.read_only_reason: Final = "the trial is being recorded: omit --out to change it" if is_recorded else ""
        self._robot: Final = robot
        self._debugger: Final = greenlet(lambda _first_stop: debugger(self))

    def attach(self, world: World, controllers: Sequence[Controller]) -> None:
        """Take control of the robot in a new or repeated trial. Raises ValueError if the robot has no firmware."""
        controller = controllers[self._robot]
        if not isinstance(controller, FirmwareController):
            kind = world.scene.robot_kind(self._robot)
            why = "its brain is scripted" if kind is EPUCK else f"it is a {kind.name}"
            raise ValueError(f"--robot {self._robot}: it has no firmware of an e-puck: {why}")
        self._world, self._controllers, self._controller = world, controllers, controller
        self._set_native(False)
        self.machine = controller.machine
        self._inputs = InputLog(self.machine)
        self._trial: greenlet | None = None
        """Greenlet of the trial; None before the robot is switched on."""
        self._is_over = False
        self._history: RobotHistory | None = None
        self._last = self._limit = 0
        self._cuts: list[int] = []
        self._final_stop: Stop | None = None
        """Stop after which the robot does not run again, for example a fault."""
        controller.control = self

    # Called in the debugger's greenlet

    def record(self, machine: Machine) -> RobotHistory:
        """Create the history in which the debugger moves."""
        self._history = RobotHistory(self, machine)
        self._history.environment = self
        return self._history

    def run_in_trial(self, act: Callable[[int], Stop | None]) -> Stop | None:
        """Call `act(limit)` in the trial's greenlet, then let the world follow. Return the stop, if there was one."""
        if self._is_over or self._trial is None:
            return Stop("limit", self.machine.pc, self.machine.cycle, OVER)
        stop: Stop | None = self._trial.switch(act)
        return stop

    @property
    def has_checkpoints(self) -> bool:
        """As `Environment.has_checkpoints`."""
        return False

    def rewind(self, cycle: int, session_state: Any) -> Machine:
        """Run the trial again from its seed; return the new machine of the robot when it is switched on."""
        assert self._trial is not None
        self._trial.switch(_request_replay)
        return self.machine

    def offer_checkpoint(self, near: int | None = None) -> None:
        """As `Environment.offer_checkpoint`: takes no checkpoint."""

    @property
    def is_over(self) -> bool:
        """Whether the trial is over."""
        return self._is_over

    @property
    def is_detached(self) -> bool:
        """Whether the debugger has detached from the robot."""
        return bool(self._debugger.dead)

    def describe(self) -> list[tuple[str, str]]:
        """Return names and values that describe the world and its robots."""
        return state_view(self._world, self._controllers, self._robot)

    # Called in the trial's greenlets

    def finish(self) -> bool:
        """Let the debugger inspect the robot after the end of the trial; return whether it ever controlled it.

        Raises ReplayRequired if the debugger goes back to an earlier cycle."""
        self._is_over = True
        if self._history is not None:
            self._history.resume()
        if self._debugger and not self._debugger.dead:
            self._trial = self._debugger.parent = getcurrent()
            self._debugger.switch(Stop("limit", self.machine.pc, self.machine.cycle, OVER))
            if not self._debugger.dead:
                raise ReplayRequired
        return self.is_detached

    def _set_native(self, is_native: bool) -> None:
        """Select whether native code or Python runs the robots (`FirmwareController.is_native`)."""
        for controller in self._controllers:
            if isinstance(controller, FirmwareController):
                controller.is_native = is_native

    def end_at_cut(self) -> None:
        """As `RobotControl.end_at_cut`."""
        self._last = min(self._last, self._limit)

    def cuts_so_far(self) -> list[int]:
        """As `RobotControl.cuts_so_far`."""
        return self._cuts

    def run_past(self, first: int, period: int, last: int, cuts: list[int]) -> Stop | None:
        """As `RobotControl.run_past`, in steps that the debugger chooses."""
        machine, began = self.machine, len(cuts)
        self._trial, self._cuts, self._last = getcurrent(), cuts, last
        self._debugger.parent = self._trial
        if self._history is not None:
            self._history.resume()
        stop = None
        while True:
            self._limit = first + period * (len(cuts) - began)
            if stop is None and machine.cycle >= self._limit:
                cuts.append(machine.cycle)
                continue
            if stop is None and machine.cycle >= self._last:
                break
            is_final = stop is not None and not (stop.reason == "breakpoint" and not stop.detail)
            act = self._debugger.switch(stop)
            if self._debugger.dead:
                self._release(act)
                return stop if is_final else machine.run_past(self._limit, period, self._last, cuts)
            if act is _request_replay:
                raise ReplayRequired
            if is_final:
                self._final_stop = stop
                break
            stop = act(min(self._limit, self._last))
            machine.pins.flush()
        if self._history is not None:
            self._history.suspend()
        return self._final_stop

    def _release(self, continues: bool) -> None:
        """Return the control to the machine after the debugger has detached; abort the trial unless it `continues`."""
        self._set_native(True)
        self._controller.control = self.machine
        self._history, self._inputs.is_recording = None, False
        if not continues:
            raise TrialAbortedError


def _request_replay(_limit: int) -> Stop | None:
    """Marker that the debugger's greenlet passes instead of a run: the trial must run again."""
    raise ReplayRequired
