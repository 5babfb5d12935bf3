"""Rewinding a debugged robot together with its environment, the trial.

The machine first goes back alone, in its own recording. Then `Environment.rewind` takes the environment to the same
time. The session continues in this process or in a checkpoint. A checkpoint is a forked copy of this process; it
receives the session's `SessionState`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, NamedTuple

from emu.dap.breakpoint_requests import BreakpointRequests
from emu.dap.breakpoints import Breakpoint
from emu.dap.debuggee import Debuggee, StopEvent
from emu.dap.state_changes import StateChange
from emu.dap.state_requests import RequestRefusedError
from emu.debug.history import History

if TYPE_CHECKING:
    from emu.dap.wire import Message
    from emu.machine.machine import Machine

ALREADY_THERE: Final = StopEvent("goto")
"""Event of a rewind for which the machine is already at the requested time."""
INTERRUPTED: Final = StopEvent("pause", "interrupted while rewinding")


class SessionState(NamedTuple):
    """State that a session hands over to the checkpoint that continues it."""

    cycle: int
    """Cycle to which the checkpoint runs."""
    event: StopEvent
    """Event that the checkpoint reports at that cycle."""
    changes: list[tuple[int, StateChange]]
    breakpoints: dict[str, list[Breakpoint]]
    stops_at_faults: bool
    last_id: int
    last_reference: int
    deferred: list[Message]
    terminate_debuggee: bool


class RewindingSession(BreakpointRequests):
    """Session that rewinds the environment together with the machine. `_record` creates the machine's recording."""

    _record: Callable[[Machine], History]
    _deferred: list[Message]
    terminate_debuggee: bool
    _is_over: bool
    _pause: bool
    _output: dict[int, bytearray]

    def __init__(self) -> None:
        self._changes: list[tuple[int, StateChange]] = []
        """The client's changes to the machine, each with its cycle."""
        self._is_muted = False
        """Whether output is discarded. During a replay the client already has it from the original run."""

    @abstractmethod
    def _is_stop_requested(self) -> bool:
        """Whether the client has requested a pause."""

    @abstractmethod
    def _write_output(self, text: str, category: str = "console") -> None:
        """Send text to the client."""

    @abstractmethod
    def _attach_output(self, machine: Machine) -> None:
        """Forward the output of the machine's UARTs from now on."""

    @abstractmethod
    def _report_stop(self, event: StopEvent) -> None:
        """Report to the client where the machine is paused."""

    def _offer_checkpoint(self) -> None:
        """Offer a checkpoint if the machine is in the present.

        Raises CheckpointResumedError in a resumed checkpoint.
        """
        history = self._target.history if self._target is not None else None
        if history is not None and history.environment is not None and not history.is_past:
            history.environment.offer_checkpoint()

    def _rewind_if_followed(self, event: StopEvent) -> StopEvent:
        """Rewind the environment too if it has checkpoints. Return the event to report."""
        history = self._debuggee.history
        follows = history.environment is not None and history.environment.has_checkpoints and history.is_past
        return self._rewind_to_machine(event) if follows else event

    def _rewind_environment(self) -> None:
        """Rewind the environment as `StateRequests` specifies."""
        history = self._debuggee.history
        if history.environment is None or not history.is_past:
            return
        event = self._rewind_to_machine(ALREADY_THERE)
        if event is not ALREADY_THERE:
            self._run_action(lambda: event)
            raise RequestRefusedError(f"interrupted while rewinding, at cycle {self._debuggee.machine.cycle:,}")

    def _rewind_to_machine(self, event: StopEvent) -> StopEvent:
        """Rewind the environment to the machine's cycle.

        Return `event`, or INTERRUPTED if the client paused the rewind.
        """
        target, environment = self._debuggee, self._debuggee.history.environment
        assert environment is not None
        cycle = target.machine.cycle
        changes = [one for one in self._changes if one[0] <= cycle]
        session_state = SessionState(cycle, event, changes, target.breakpoints, target.stops_at_faults, self._last_id,
                    self._references.last_reference, self._deferred, self.terminate_debuggee)  # fmt: skip
        self._pause = False
        machine = environment.rewind(cycle, session_state)
        self._write_output(f"replaying the trial up to cycle {cycle:,}\n")
        fresh = Debuggee(machine, self._is_stop_requested, self._write_output, self._record(machine))
        self._target, self._references.inspector = fresh, fresh.inspector
        self._attach_output(machine)
        is_there = self._replay_changes(cycle, [], changes)
        fresh.install_breakpoints(target.breakpoints, target.stops_at_faults)
        return event if is_there else INTERRUPTED

    def _resume_session(self, session_state: SessionState) -> None:
        """Continue the session in this resumed checkpoint, with the state passed by the earlier process."""
        target = self._debuggee
        target.install_breakpoints({}, session_state.stops_at_faults)
        self._last_id, self._references.last_reference = session_state.last_id, session_state.last_reference
        self._deferred, self.terminate_debuggee, self._pause = (
            session_state.deferred,
            session_state.terminate_debuggee,
            False,
        )
        self._references.clear()
        self._output.clear()
        is_there = self._replay_changes(session_state.cycle, self._changes, session_state.changes)
        target.install_breakpoints(session_state.breakpoints, session_state.stops_at_faults)
        if not self._is_over:
            self._report_stop(session_state.event if is_there else INTERRUPTED)

    def _replay_changes(
        self, cycle: int, done: list[tuple[int, StateChange]], changes: list[tuple[int, StateChange]]
    ) -> bool:
        """Run to a cycle, ignore breakpoints, and repeat `changes`, of which `done` are already made.

        Return False if the client requested a pause before that cycle.
        """
        target = self._debuggee
        self._changes, self._is_muted = list(done), True
        try:
            for at, change in changes[len(done) :]:
                if not self._run_to(at, target):
                    return False
                change.apply(target.inspector)
                self._changes.append((at, change))
            return self._run_to(cycle, target)
        finally:
            self._is_muted = False

    def _run_to(self, cycle: int, target: Debuggee) -> bool:
        environment = target.history.environment
        if environment is not None and environment.has_checkpoints:
            return target.run_to_cycle(cycle, lambda: environment.offer_checkpoint(cycle))
        return target.run_to_cycle(cycle)

    def _apply(self, change: StateChange) -> None:
        """Apply a change as `StateRequests` specifies."""
        read_only_reason = self._debuggee.history.read_only_reason
        if read_only_reason:
            raise RequestRefusedError(read_only_reason)
        self._rewind_environment()
        change.apply(self._debuggee.inspector)
        if self._debuggee.history.environment is not None:
            self._changes.append((self._debuggee.machine.cycle, change))
