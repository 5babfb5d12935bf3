"""Debugger control of one robot of a trial: the whole world pauses with the robot, and the record is unaffected.

There are two greenlets: that of the trial, in which the robot runs, and that of the debugger. The machine runs forward
only in the trial's greenlet, at most to the next end of a quantum. All its inputs therefore come from the world.
Between two such runs, the debugger decides how far the machine may run.

The inputs of the robot are logged (`InputLog`, `CrowdMember`). The debugger's greenlet can therefore run the past of
the robot again without the world, which stays in the present. If the user inspects the world of the past, or changes
the past, `ReplayRequired` aborts the trial. The trial then runs again from its seed to the cycle of the robot. The new
robots equal the old ones to the bit, and the debugger continues with them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final, cast

from greenlet import getcurrent, greenlet

from arena.debug.crowd_member import CrowdMember
from arena.debug.input_log import InputLog
from arena.debug.robot_history import NO_LIMIT, EpuckRobotHistory, KilobotRobotHistory, RobotHistory
from arena.robots.controller import Controller
from arena.robots.firmware_controller import FirmwareController
from arena.robots.kilobot import KilobotController
from arena.scene.robot_kind import EPUCK
from arena.trial.snapshot import state_view
from arena.world.physics import World
from emu.debug.avr.machine import DebuggedKilobot
from emu.machine.stops import Stop

if TYPE_CHECKING:
    from emu.machine.machine import Machine

OVER: Final = "the trial is over"


class TrialAbortedError(Exception):
    """The debugger client has ended the trial before its end."""


class ReplayRequired(Exception):
    """The trial must run again from its seed, because the debugger has gone back to an earlier cycle."""


class ControlledRobot:
    """Robot number `robot` of a trial, controlled by `debugger`: the `RobotControl` of an e-puck, or the `CrowdControl`
    of a Kilobot's crowd.

    `debugger` is called in a greenlet of its own when the robot is switched on. It creates a history with `record`. If
    it returns true, the trial continues without it; if it returns false, `TrialAbortedError` ends the trial. With
    `is_recorded` the trial is recorded, and the debugger must not change it.

    The runner of the trial calls `attach` with world and robots first. When the trial ends in `ReplayRequired`, the
    runner starts it again.
    """

    def __init__(self, robot: int, debugger: Callable[[ControlledRobot], bool], is_recorded: bool) -> None:
        self.is_recorded: Final = is_recorded
        self._robot: Final = robot
        self._debugger: Final = greenlet(lambda _first_stop: debugger(self))

    def attach(self, world: World, controllers: Sequence[Controller]) -> None:
        """Take control of the robot in a new or repeated trial. Raises ValueError if the robot has no firmware."""
        controller = controllers[self._robot]
        if not isinstance(controller, FirmwareController | KilobotController):
            kind = world.scene.robot_kind(self._robot)
            why = "its brain is scripted" if kind is EPUCK else f"it is a {kind.name}"
            raise ValueError(f"--robot {self._robot}: it has no firmware for the debugger: {why}")
        self._world, self._controllers, self._controller = world, controllers, controller
        self._set_native(False)
        if isinstance(controller, FirmwareController):
            self.machine: Machine = controller.machine
            self._inputs = InputLog(self.machine)
            controller.control = self
        else:
            self._member = CrowdMember(controller.crowd, controller.index)
            kilobot = DebuggedKilobot(self._member)
            controller.crowd.breakpoints.debug(controller.index, kilobot)
            self.machine = cast("Machine", kilobot)
            controller.crowd.control = self
        self._trial: greenlet | None = None
        """Greenlet of the trial; None before the robot is switched on."""
        self._is_over = False
        self._history: RobotHistory | None = None
        self._last = self._limit = 0
        self._cuts: list[int] = []
        self._final_stop: Stop | None = None
        """Stop after which the robot does not run again, for example a fault."""
        self._held_stop: Stop | None = None
        """Stop of a Kilobot at the end of a quantum. The debugger gets it after the world's inputs of this cycle."""

    # Called in the debugger's greenlet

    def record(self, machine: Machine) -> RobotHistory:
        """Create the history in which the debugger moves."""
        self._history = self._new_history(machine)
        self._history.environment = self
        return self._history

    def _new_history(self, machine: Machine) -> RobotHistory:
        """Return a new history of the robot, which cannot move the world."""
        if isinstance(self._controller, KilobotController):
            return KilobotRobotHistory(machine, self.run_in_trial, self.read_only, self._member)
        return EpuckRobotHistory(machine, self.run_in_trial, self.read_only)

    def read_only(self, is_past: bool) -> str:
        """Return why the machine must not be changed in the past or the present; empty if changes are permitted."""
        return "the trial is being recorded: omit --out to change it" if self.is_recorded else ""

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
        if isinstance(self._controller, KilobotController) and self._final_stop is None:
            self._member.machine.apply_due()
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

    def run_crowd(self, end: int) -> None:
        """As `CrowdControl.run_crowd`, in steps that the debugger chooses."""
        assert isinstance(self._controller, KilobotController)
        member, crowd = self._member, self._controller.crowd
        member.end = end
        if self._final_stop is None:
            member.run_until(self.machine.cycle)
            if member.is_at_end:  # the robot is not switched on yet, or its last instruction has passed `end`
                return
        stop, self._held_stop = self._held_stop, None
        self._trial = self._debugger.parent = getcurrent()
        if self._history is not None:
            self._history.resume()
        while not member.is_at_end and self._final_stop is None:
            act = self._debugger.switch(stop)
            if self._debugger.dead:
                self._release(act)
                break
            if act is _request_replay:
                raise ReplayRequired
            if stop is not None and stop.reason == "fault":
                self._final_stop = stop
                member.release()
                break
            stop = act(NO_LIMIT)
        self._held_stop = stop
        if not member.is_at_end:
            crowd.run_until(end)
        if self._history is not None:
            self._history.suspend()

    def _release(self, continues: bool) -> None:
        """Return the control to the machine after the debugger has detached; abort the trial unless it `continues`."""
        self._set_native(True)
        self._history = None
        if isinstance(self._controller, KilobotController):
            self._member.release()
            self._controller.crowd.control = None
        else:
            self._controller.control = self.machine
            self._inputs.is_recording = False
        if not continues:
            raise TrialAbortedError


def _request_replay(_limit: int) -> Stop | None:
    """Marker that the debugger's greenlet passes instead of a run: the trial must run again."""
    raise ReplayRequired
