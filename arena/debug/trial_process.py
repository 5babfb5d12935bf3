"""Process of a trial with a debugger on one of its robots; forks checkpoints to which the whole trial can go back.

The process exchanges tagged tuples with the client's process (`arena/debug/trial_client.py`) over a pipe. Messages of
the debug protocol pass unchanged.

| sent | meaning |
|---|---|
| `ready`, `waits` count | the server was started; it waits for a message and has received `count` |
| `says` message | message of the Debug Adapter Protocol for the client |
| `checkpoint` cycle, seconds, with a pipe | a checkpoint was forked at this time of the robot |
| `rewind` cycle, count | the trial must go back; the reply `(True,)` announces that a checkpoint will continue |
| `leaves` state, messages | the process ends; state and unread messages for the checkpoint that continues |
| `left`, `alive` | the client has disconnected; the trial continues without it |
| `recorded` trial | end of the trial and of its record |
| `over` fault, controlled | end of the process: the two results of `_run` |
| `failed` error | end of the process: the exception that ended the trial |

A checkpoint blocks until it receives `("fork",)`, which asks for a fork of itself, or `("resume", state, count)`.
"""

from __future__ import annotations

import os
import signal
import socket
from collections import deque
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final

from arena.campaign.campaign import Plan, run_one
from arena.debug.controlled_robot import ControlledRobot, ReplayRequired
from arena.scene.loader import FCY
from arena.trial.checkpoints import CAN_FORK, PipeClosedError, PipeEnd, ProcessForker
from emu.dap.server import Server
from emu.dap.wire import Message
from emu.debug.environment import CheckpointResumedError
from emu.machine.machine import Machine

NEAR: Final = FCY // 10
"""Cycles before the target of a rewind at which a checkpoint is forked, so that the next step back is fast."""
SINGLE_ROBOT_ARGUMENTS: Final = ("board", "selector", "camera", "engine", "strict")
"""Launch arguments of `emu debug` that a robot of a trial does not have."""


class _PipeInbox(SimpleQueue[Message | None]):
    """Messages of the client that arrive on a pipe."""

    def __init__(self, pipe: PipeEnd) -> None:
        self.pipe = pipe
        self.count = 0
        """Number of messages that `get` has returned."""
        self._pending: deque[Message | None] = deque()

    def empty(self) -> bool:
        return not self._pending and not self.pipe.is_ready(0)

    def get(self, block: bool = True, timeout: float | None = None) -> Message | None:
        if self.empty():
            self.pipe.send(("waits", self.count))
        message: Message | None = self._pending.popleft() if self._pending else self.pipe.receive()[0]
        self.count += 1
        return message

    def next_tuple(self) -> Any:
        """Return the next tuple from the pipe; queue the messages that arrive before it."""
        while not isinstance(received := self.pipe.receive()[0], tuple):
            self._pending.append(received)
        return received

    def pending(self) -> list[Message | None]:
        """Return the messages that `get` has not returned."""
        return [*self._pending]


class _PipeChannel:
    """Channel of the protocol server: the client is at the other end of a pipe."""

    def __init__(self, pipe: PipeEnd) -> None:
        self.inbox: Final = _PipeInbox(pipe)

    def send(self, message: Message) -> None:
        """Send a message to the client."""
        self.inbox.pipe.send(("says", message))


class CheckpointedRobot(ControlledRobot):
    """Robot number `robot` of a trial, controlled by the client at the other end of `pipe`.

    A checkpoint of the process is forked every `every_s` simulated seconds.
    """

    def __init__(self, robot: int, pipe: PipeEnd, is_recorded: bool, every_s: float) -> None:
        super().__init__(robot, lambda _controlled: self._serve(), is_recorded)
        self.channel: Final = _PipeChannel(pipe)
        self._every_s: Final = every_s
        self._forker: Final = ProcessForker()
        self._checkpoint_cycle: int | None = None
        """Cycle of the robot at the last checkpoint."""

    def send(self, *what: Any, end: PipeEnd | None = None) -> None:
        """Send a tuple to the client's process. Raises PipeClosedError."""
        self.channel.inbox.pipe.send(what, end)

    def _serve(self) -> bool:
        self.send("ready")
        server = Server(self.channel, self._launch, self.record)
        server.serve()
        self.send("left")
        return self.is_recorded and not server.terminate_debuggee

    def _launch(self, arguments: dict[str, Any]) -> Machine:
        """Return the robot's machine as response to `launch`. Raises ValueError for an argument of a single robot."""
        for name in SINGLE_ROBOT_ARGUMENTS:
            if name in arguments:
                raise ValueError(f"`{name}` is for a robot alone; in a swarm the scene says it: --set KEY=VALUE")
        return self.machine

    @property
    def has_checkpoints(self) -> bool:
        """As `Environment.has_checkpoints`."""
        return CAN_FORK

    def offer_checkpoint(self, near: int | None = None) -> None:
        """As `Environment.offer_checkpoint`. After the end of the trial, none is forked."""
        cycle, last = self.machine.cycle, self._checkpoint_cycle
        is_due = last is None or cycle - last >= self._every_s * self.machine.hz
        if near is not None and last is not None and not is_due:
            is_due = near - cycle <= NEAR < (cycle - last) // 2
        if is_due and CAN_FORK and not self.is_over:
            self._checkpoint_cycle = cycle
            self._checkpoint()

    def rewind(self, cycle: int, session_state: Any) -> Machine:
        """End this process in favour of a checkpoint; without a checkpoint, run the trial again from its seed."""
        inbox = self.channel.inbox
        self.send("rewind", cycle, inbox.count)
        (has_checkpoint,) = inbox.next_tuple()
        if has_checkpoint:
            self.send("leaves", session_state, inbox.pending())
            os._exit(0)
        self._checkpoint_cycle = None
        return super().rewind(cycle, session_state)

    def _checkpoint(self) -> None:
        """Fork a checkpoint. The checkpoint blocks until it is resumed; then it raises CheckpointResumedError."""
        pipe, is_fork = self._fork()
        if not is_fork:
            if pipe is not None:
                self.send("checkpoint", self.machine.cycle, self.machine.seconds, end=pipe)
                pipe.drop()
            return
        assert pipe is not None
        self.channel.inbox.pipe.drop()
        try:
            pipe, state, count = self._await_resume(pipe)
        except PipeClosedError:
            os._exit(0)  # the checkpoint was discarded; a forked process must not run the exit handlers of its parent
        self.channel.inbox.count, self.channel.inbox.pipe = count, pipe
        raise CheckpointResumedError(state)

    def _await_resume(self, pipe: PipeEnd) -> tuple[PipeEnd, Any, int]:
        """Block in a checkpoint until it is resumed, forking it on request.

        Return its pipe, the state of the session, and the number of messages that the session has received."""
        while True:
            command, *arguments = pipe.receive()[0]
            if command == "resume":
                state, count = arguments
                return pipe, state, count
            other, is_fork = self._fork()
            if is_fork:
                assert other is not None
                pipe.drop()
                pipe = other
                continue
            pipe.send(other is not None, other)
            if other is not None:
                other.drop()

    def _fork(self) -> tuple[PipeEnd | None, bool]:
        """Fork this process; return the pipe to the other process, and whether this is the fork."""
        try:
            return self._forker.fork()
        except OSError:
            return None, False


def serve(end: socket.socket, plan: Plan, robot: int, folder: Path, is_recorded: bool, every_s: float) -> None:
    """Run the trial of `plan` into `folder` with a debugger on `robot`, whose client is at the other end of a pipe.

    The last tuple sent is `over`, or `failed` with the exception that ended the trial."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the client's process handles Ctrl-C
    controlled = CheckpointedRobot(robot, PipeEnd(end), is_recorded, every_s)
    with suppress(PipeClosedError):
        try:
            controlled.send("over", *_run(controlled, plan, folder))
        except PipeClosedError:
            raise
        except Exception as error:
            controlled.send("failed", error)
    os._exit(0)  # a forked process must not run the exit handlers of its parent


def _run(controlled: CheckpointedRobot, plan: Plan, folder: Path) -> tuple[bool, bool]:
    """Run the trial until it is over and the debugger has detached.

    Return whether a robot had a fault, and whether the debugger ever controlled its robot."""

    def progress(_trial: int, _seconds: float) -> None:
        if controlled.is_detached:
            controlled.send("alive")  # raises PipeClosedError when the client's process has ended

    while True:
        try:
            finished = run_one(plan, 1, folder, progress, on_start=controlled.attach)
            controlled.send("recorded", finished)
            return bool(finished.faults), controlled.finish()
        except ReplayRequired:
            continue
