"""Interactive trial: runs, pauses, steps by quanta and rewinds; the user can move robots and objects.

The session runs in a process of its own and executes the commands that arrive on a pipe (`arena/studio/process.py`). It
records every action on the world with its quantum. A trial that starts again from its seed, or continues from a
checkpoint of this process, replays these actions and reaches the same state to the byte.
"""

from __future__ import annotations

import os
import signal
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

from arena.campaign.campaign import Plan, controllers_of
from arena.debug.attach import AttachedRobot
from arena.replay.page import sample_data
from arena.robots.firmware_controller import FirmwareController, function_at
from arena.robots.kilobot import KilobotController
from arena.scene.loader import SceneError
from arena.studio.errors import CommandRefusedError
from arena.trial.checkpoints import CAN_FORK, PipeClosedError, PipeEnd, ProcessForker
from arena.trial.record import Trial
from arena.trial.snapshot import state_digest
from arena.trial.trial import RunningTrial

POLL_S: Final = 0.05
"""Longest time, in seconds, between two looks of a paused trial at its pipe."""
MAX_FRAMES: Final = 12
"""Frames of a call stack that `inspect` returns."""


class Action(NamedTuple):
    """A change of the world between two quanta, which can be replayed: a method of `Supervisor` and its arguments."""

    tick: int
    name: str
    arguments: tuple[Any, ...]

    def apply(self, running: RunningTrial) -> None:
        """Apply the action to a trial."""
        getattr(running.supervisor, self.name)(*self.arguments)
        running.refresh_poses()


class RewindState(NamedTuple):
    """State with which a checkpoint replaces this process: actions, breakpoints, epoch and target."""

    actions: list[Action]
    breakpoints: list[tuple[int, str]]
    epoch: int
    tick: int


def serve(end: socket.socket, plan: Plan, seed: int) -> None:
    """Run trial `seed` of `plan` under the commands of a pipe until the pipe is closed.

    The first reply is empty, or carries the exception with which creating the trial failed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process handles Ctrl-C
    with suppress(PipeClosedError):
        TrialSession(plan, seed, PipeEnd(end)).serve()
    os._exit(0)  # a forked process must not run the exit handlers of its parent


class TrialSession:
    """Trial `seed` of `plan`, controlled by commands from `pipe`. Commands are the public methods of the class."""

    def __init__(self, plan: Plan, seed: int, pipe: PipeEnd) -> None:
        self._plan: Final = plan
        self._seed: Final = seed
        self._pipe = pipe
        self._forker: Final = ProcessForker()
        self._actions: list[Action] = []
        self._replay: deque[Action] = deque()
        """Actions that a rewind has yet to replay."""
        self._target: int | None = None
        """Quantum at which the trial pauses; None while it is paused."""
        self._pace = 1.0
        self._breakpoints: dict[tuple[int, str], Callable[[], None]] = {}
        self._hit = ""
        """Description of the breakpoint at which the trial is paused."""
        self._is_held = False
        """Whether the trial must stay at the breakpoint."""
        self._failure = ""
        """Message of the exception that has stopped the trial."""
        self._attached: AttachedRobot | None = None
        self._is_detach_requested = False
        self._is_modified = False
        """Whether a debugger may have changed the trial in a way that a replay does not repeat."""
        self._is_closed = False
        self.epoch = 0
        """Number of times the trial was started; samples of another epoch are not those of this one."""

    # -- commands ----------------------------------------------------------------------------------------------------

    def run(self, pace: float = 1.0) -> None:
        """Run to the end or until `pause`, at most `pace` times as fast as real time; continue from a breakpoint."""
        if not pace > 0:
            raise CommandRefusedError(f"{pace} times as fast as real time: expected a positive number")
        self._require_no_failure()
        if not self._hit:
            self._require_no_debugger()
        self._pace, self._is_held = pace, False
        self._target = self._running.quanta

    def pause(self) -> None:
        """Pause at the end of the present quantum. A rewind ends there, and later actions are discarded."""
        self._require_no_debugger()
        self._target = None
        self._discard_after(self._running.world.ticks)

    def step(self, quanta: int = 1) -> None:
        """Run for `quanta` quanta and pause."""
        self._require_between_quanta()
        self._require_no_failure()
        if quanta < 1:
            raise CommandRefusedError(f"{quanta} quanta: expected 1 or more")
        self._discard_after(self._running.world.ticks)
        self._pace, self._target = 0.0, min(self._running.world.ticks + quanta, self._running.quanta)

    def rewind(self, tick: int) -> None:
        """Go to the end of quantum `tick`, discarding later actions. An earlier quantum is reached by a replay from the
        seed."""
        self._require_target(tick)
        self._discard_after(tick)
        if tick < self._running.world.ticks:
            self._start_trial()
            self._replay = deque(self._actions)
            self._replay_due_actions()
        self._pace, self._target = 0.0, tick

    def rewind_state(self, tick: int) -> RewindState | None:
        """Return what a checkpoint needs to continue to `tick`; None if `tick` is not in the past."""
        self._require_target(tick)
        if tick >= self._running.world.ticks:
            return None
        actions = [action for action in self._actions if action.tick <= tick]
        return RewindState(actions, list(self._breakpoints), self.epoch + 1, tick)

    def checkpoint(self, state: RewindState | None = None) -> PipeEnd | None:
        """Fork a checkpoint of this process and return a pipe to it; None if the system cannot fork.

        The fork blocks until it receives this command. It then forks a checkpoint in turn, and continues with `state`.
        """
        while True:
            try:
                pipe, is_fork = self._forker.fork()
            except OSError:
                pipe, is_fork = None, False
            if not is_fork:
                if state is not None:
                    self._restore(state)
                return pipe
            assert pipe is not None
            self._pipe.drop()
            self._pipe = pipe
            ((_, (state,), _),), _ = self._pipe.receive()

    def move(self, kind: str, number: int, x: float, y: float) -> None:
        """Place robot or object `number` at (x, y), in cm."""
        self._require_between_quanta()
        if kind not in ("robot", "object"):
            raise CommandRefusedError(f"{kind!r} cannot be moved; expected robot or object")
        if not 0 <= number < len(getattr(self._running.world, f"{kind}s")):
            raise CommandRefusedError(f"there is no {kind} {number}")
        self._act(f"move_{kind}", number, x, y)

    def send(self, robot: int, text: str) -> None:
        """Send `text` to a robot by Bluetooth."""
        self._require_between_quanta()
        if isinstance(self._controller(robot), KilobotController):
            raise CommandRefusedError(f"robot {robot} is a kilobot: it has no Bluetooth")
        try:
            text.encode("latin-1")
        except UnicodeEncodeError:
            raise CommandRefusedError("Bluetooth carries bytes: use Latin-1 characters only") from None
        self._act("tell", robot, text)

    def toggle_breakpoint(self, robot: int, place: str) -> None:
        """Set a breakpoint at a function of one robot, or delete it. The whole world pauses at a breakpoint."""
        controller = self._controller_with_firmware(robot)
        key = robot, place
        if key in self._breakpoints:
            self._breakpoints.pop(key)()
            return
        try:
            if isinstance(controller, KilobotController):
                add = controller.crowd.breakpoints.add
                remove = add(controller.index, place, lambda: self._on_breakpoint(robot, place))
            else:
                remove = controller.machine.hook_pc(place, lambda *_: self._on_breakpoint(robot, place))
        except (KeyError, ValueError) as error:
            raise CommandRefusedError(f"robot {robot}: {error.args[0]}") from None
        self._breakpoints[key] = remove

    def debug(self, robot: int) -> None:
        """Attach a debugger to a robot, or detach it; `status` names the TCP port that serves one client.

        While a client is attached, the world moves only as far as the client lets the robot run. A rewind does not
        repeat what the client has changed."""
        if self._attached is not None and not self._hit:
            self._is_detach_requested = True
            return
        self._require_between_quanta()
        self._require_no_failure()
        if self._running.is_over:
            raise CommandRefusedError("the trial is over")
        if self._controller_with_firmware(robot).has_stopped:
            raise CommandRefusedError(f"robot {robot}: its firmware has stopped; rewind first")
        self._discard_after(self._running.world.ticks)
        self._is_detach_requested = False
        try:
            self._attached = AttachedRobot(robot, self._poll)
        except OSError as error:
            raise CommandRefusedError(f"no port for a debugger: {error.strerror}") from None
        self._attached.attach(self._running.world, self._running.controllers)
        self._pace, self._target = 0.0, self._running.quanta

    def status(self) -> dict[str, Any]:
        """Return the present state of the trial; lengths in cm, angles in rad, times in s."""
        world, attached = self._running.world, self._attached
        return {
            "tick": world.ticks, "t": world.seconds, "epoch": self.epoch, "quanta": self._running.quanta,
            "robots": world.poses.robots, "objects": world.object_poses(), "hit": self._hit,
            "breakpoints": [f"{robot} {place}" for robot, place in self._breakpoints],
            "debugger": {"robot": attached.robot, "port": attached.port, "is_connected": attached.is_connected}
                        if attached else None,
            "state": self._state(),
        }  # fmt: skip

    def _state(self) -> str:
        """Return the state of the trial as the page shows it."""
        if self._failure:
            return f"failed: {self._failure}"
        if self._hit:
            return "at a breakpoint"
        if self._attached:
            return "in a debugger"
        if self._running.is_over:
            return "over"
        if self._target is None:
            return "paused"
        return "rewinding" if self._replay else "running"

    def more(self, first: int, epoch: int) -> dict[str, Any]:
        """Return `status` and the samples from number `first` on; all samples if `epoch` is not the present epoch."""
        columns = self._running.result.rows.columns
        begin = first if epoch == self.epoch else 0
        about = self._metadata | {"faults": [list(fault) for fault in self._running.result.faults]}
        found: dict[str, Any] = {}
        if begin < len(columns["t"]):
            rows = {name: values[begin:] for name, values in columns.items()}
            found = sample_data(Trial(Path("studio"), rows, about))
        return found | {"from": begin, "now": self.status()}

    def trial(self) -> Trial:
        """Return the samples so far as a trial."""
        faults = [list(fault) for fault in self._running.result.faults]
        columns = {name: list(values) for name, values in self._running.result.rows.columns.items()}
        return Trial(Path("studio"), columns, self._metadata | {"faults": faults})

    def inspect(self, robot: int) -> dict[str, Any]:
        """Return registers, call stack and threads of a robot; lines of text of a Kilobot; a flag for a script."""
        controller = self._controller(robot)
        if isinstance(controller, KilobotController):
            return {"robot": robot, "lines": controller.inspection()}
        if not isinstance(controller, FirmwareController):
            return {"robot": robot, "script": True}
        machine = controller.machine
        return {
            "robot": robot, "pc": machine.pc, "place": function_at(machine), "cycle": machine.cycle,
            "sr": machine.peek("SR"),
            "asleep": machine.is_asleep, "w": [machine.peek(f"W{n}") for n in range(16)],
            "frames": [str(frame) for frame in machine.backtrace()[:MAX_FRAMES]],
            "threads": [{"name": one.name, "pid": one.pid, "state": one.state, "used": one.used,
                         "size": one.stack and one.stack[1] - one.stack[0]} for one in machine.threads()],
        }  # fmt: skip

    def digest(self) -> str:
        """Return the SHA-256 of the whole state: all bodies with their speeds, and all machines."""
        return state_digest(self._running.world, self._running.controllers)

    # -- main loop ---------------------------------------------------------------------------------------------------

    def serve(self) -> None:
        """Execute commands and run the trial until the pipe is closed.

        Raises PipeClosedError if the pipe is closed before the trial exists."""
        self._controllers_context: AbstractContextManager[Any] | None = None
        try:
            self._start_trial()
        except Exception as error:
            self._pipe.send((error,))
            return
        self._reply([])
        while not self._is_closed:
            if self._target is None or self._running.is_over or self._running.world.ticks >= self._target:
                self._target = None
                self._execute_commands(POLL_S)
            else:
                try:
                    self._advance()
                except Exception as error:  # usually from a supervisor; the state before it can still be inspected
                    self._target, self._failure = None, f"{error}"
        self._close_controllers()

    def _advance(self) -> None:
        """Run to the next sample, action or target, no faster than the pace."""
        if self._attached is not None:
            self._advance_attached(self._attached)
            return
        assert self._target is not None
        running, start, before = self._running, time.monotonic(), self._running.world.seconds
        running.advance(min(self._target, self._replay[0].tick) if self._replay else self._target)
        self._replay_due_actions()
        self._execute_commands(0)
        while self._pace and not self._is_closed and self._target is not None:
            left = (running.world.seconds - before) / self._pace - (time.monotonic() - start)
            if left <= 0:
                break
            self._execute_commands(min(left, POLL_S))

    def _advance_attached(self, attached: AttachedRobot) -> None:
        """Run one quantum under the debugger; detach it at the end of the trial or on request."""
        running = self._running
        running.advance(running.world.ticks + 1)
        if running.is_over:
            attached.finish()
            attached.close()
        if attached.is_closed:
            self._is_modified |= attached.is_connected
            self._attached, self._target = None, None

    def _execute_commands(self, wait: float) -> None:
        """Execute the next batch of commands and reply; wait at most `wait` seconds for it."""
        try:
            if not self._pipe.is_ready(wait):
                return
            calls, _ = self._pipe.receive()
            try:
                results = [getattr(self, name)(*arguments, **named) for name, arguments, named in calls]
            except PipeClosedError:
                raise
            except Exception as error:
                self._pipe.send((error,))
                return
            self._reply(results)
        except PipeClosedError:
            self._is_closed, self._is_held = True, False

    def _reply(self, results: list[Any]) -> None:
        """Send the results of a batch, the present time, and whether a checkpoint may be taken now."""
        end = results[0] if results and isinstance(results[0], PipeEnd) else None
        world = self._running.world
        is_plain = not (self._hit or self._attached or self._failure or self._is_modified)
        self._pipe.send((None, [] if end else results, (world.ticks, world.seconds, CAN_FORK and is_plain)), end)
        if end is not None:
            end.drop()

    def _poll(self, wait: float) -> bool:
        """Execute commands while a debugger has a robot; return whether the debugger may keep it."""
        self._execute_commands(wait)
        return not (self._is_closed or self._is_detach_requested)

    def _start_trial(self) -> None:
        """Start the trial from its seed, with the breakpoints that are set."""
        self._close_controllers()
        self._failure, self._is_modified = "", False
        context = controllers_of(self._plan, self._seed)
        controllers, channel = context.__enter__()
        self._controllers_context = context
        plan = self._plan
        self._running = RunningTrial(
            plan.scene, self._seed, controllers, plan.seconds, channel=channel, experiment=plan.loaded_experiment
        )
        self._metadata: dict[str, Any] = plan.key() | {"seed": self._seed}
        self.epoch += 1
        breakpoints, self._breakpoints = list(self._breakpoints), {}
        for robot, place in breakpoints:
            self.toggle_breakpoint(robot, place)

    def _close_controllers(self) -> None:
        if self._controllers_context is not None:
            self._controllers_context.__exit__(None, None, None)
            self._controllers_context = None

    def _restore(self, state: RewindState) -> None:
        """Continue this checkpoint in place of a process that had run further and left `state`."""
        applied = len(self._actions) - len(self._replay)
        self._actions, self._replay = state.actions, deque(state.actions[applied:])
        self.epoch, self._pace, self._target = state.epoch, 0.0, state.tick
        deleted = set(self._breakpoints) - set(state.breakpoints)
        added = [one for one in state.breakpoints if one not in self._breakpoints]
        for robot, place in (*deleted, *added):
            self.toggle_breakpoint(robot, place)
        self._replay_due_actions()

    def _act(self, name: str, *arguments: Any) -> None:
        """Apply and record an action. Raises CommandRefusedError if the scene does not permit it."""
        if self._replay:
            raise CommandRefusedError("the trial is rewinding; pause it first")
        action = Action(self._running.world.ticks, name, arguments)
        try:
            action.apply(self._running)
        except SceneError as error:
            raise CommandRefusedError(str(error)) from None
        self._actions.append(action)

    def _discard_after(self, tick: int) -> None:
        """Discard the actions that come after `tick` quanta."""
        self._actions = [action for action in self._actions if action.tick <= tick]
        self._replay = deque(action for action in self._replay if action.tick <= tick)

    def _replay_due_actions(self) -> None:
        """Apply the actions of the replay that are due at the present quantum."""
        while self._replay and self._replay[0].tick <= self._running.world.ticks:
            self._replay.popleft().apply(self._running)

    def _on_breakpoint(self, robot: int, place: str) -> bool:
        """Execute commands while a robot is at a breakpoint, in the middle of a quantum, until `run` continues it."""
        controller = self._controller(robot)
        is_past = isinstance(controller, FirmwareController) and controller.machine.events.quiet
        if self._replay or self._is_closed or is_past:
            return False
        self._hit, self._is_held = f"robot {robot} is at {place}", True
        while self._is_held:
            self._execute_commands(POLL_S)
        self._hit = ""
        return False

    def _require_target(self, tick: int) -> None:
        """Raise CommandRefusedError unless the trial can go to quantum `tick` now."""
        self._require_between_quanta()
        if not 0 <= tick <= self._running.quanta:
            raise CommandRefusedError(f"quantum {tick}: expected 0 to {self._running.quanta}")

    def _require_between_quanta(self) -> None:
        """Raise CommandRefusedError while a robot is at a breakpoint or in a debugger."""
        if self._hit:
            raise CommandRefusedError(f"{self._hit}; run the trial first")
        self._require_no_debugger()

    def _require_no_debugger(self) -> None:
        """Raise CommandRefusedError while a robot is in a debugger."""
        if self._attached is not None:
            raise CommandRefusedError(f"robot {self._attached.robot} is in a debugger; detach the debugger first")

    def _require_no_failure(self) -> None:
        """Raise CommandRefusedError after an exception has stopped the trial."""
        if self._failure:
            raise CommandRefusedError(f"the trial has failed ({self._failure}); rewind first")

    def _controller(self, robot: int) -> Any:
        """Return the controller of a robot. Raises CommandRefusedError if it does not exist."""
        if not 0 <= robot < len(self._running.controllers):
            raise CommandRefusedError(f"there is no robot {robot}")
        return self._running.controllers[robot]

    def _controller_with_firmware(self, robot: int) -> FirmwareController | KilobotController:
        """Return the controller of a robot with firmware. Raises CommandRefusedError for another robot."""
        controller = self._controller(robot)
        if not isinstance(controller, FirmwareController | KilobotController):
            raise CommandRefusedError(f"robot {robot} is scripted: it has no firmware")
        return controller
