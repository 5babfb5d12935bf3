"""Client side of a debugged trial: its process, its checkpoints, and the messages between client and server.

A rewind resumes the checkpoint with the latest time before its target. The process that had run further hands over the
state of the session and ends. Without a checkpoint, the trial runs again from its seed in the same process.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from threading import Lock, Thread
from typing import Any, Final

from arena.campaign.campaign import FinishedTrial, Plan
from arena.debug.trial_process import serve
from arena.trial.checkpoints import EVERY_S, PATIENCE_S, Checkpoint, CheckpointPool, PipeClosedError, context, pipe
from arena.trial.record import RecordError
from emu.dap.wire import Channel, Message, Wire

POLL_S: Final = 0.05
"""Longest time, in seconds, between two looks at the client's inbox while the server is busy."""


class DebugSession:
    """Trial of `plan` with a debugger on `robot`; in `folder` it is recorded if `is_recorded`.

    The constructor returns when the robot is switched on, or the trial is over. A checkpoint is forked every `every_s`
    simulated seconds. `close` ends the trial.

    Raises what creating the trial raises: SceneError, emu.LoadError, ValueError for a robot without firmware.
    """

    def __init__(self, plan: Plan, robot: int, folder: Path, is_recorded: bool, every_s: float = EVERY_S) -> None:
        self._lock: Final = Lock()
        self._checkpoints: Final = CheckpointPool()
        self._pipe, there = pipe()
        arguments = there.end, plan, robot, folder, is_recorded, every_s
        self._process: Final = context().Process(target=serve, args=arguments, daemon=True)
        self._process.start()
        there.drop()
        self._sent = 0
        """Number of messages that the client has sent."""
        self.finished: FinishedTrial | None = None
        """The finished trial, once it has ended; a rewind may follow."""
        self.is_over = False
        """Whether the trial has ended and cannot be rewound any more."""
        self.is_detached = False
        """Whether the debugger has detached from the robot."""
        self.has_fault = False
        """Whether a robot had a fault."""
        self.had_robot = False
        """Whether the debugger ever controlled its robot."""
        try:
            while not self.is_over and self.receive() != ("ready",):
                pass
        except BaseException:
            self.close()
            raise

    def send(self, message: Message | None) -> None:
        """Send a message of the client to the server; None if the client has disconnected."""
        with self._lock, suppress(PipeClosedError):
            self._pipe.send(message)
            self._sent += 1

    def receive(self) -> tuple[Any, ...]:
        """Process and return the next tuple from the trial's process (see `arena/debug/trial_process.py`).

        Raises the exception that ended the trial, and RecordError if its process was killed."""
        try:
            received, end = self._pipe.receive()
            match received:
                case ("checkpoint", cycle, seconds):
                    assert end is not None
                    self._checkpoints.add(Checkpoint(cycle, seconds, end))
                case ("rewind", cycle, count):
                    self._rewind(cycle, count)
                case ("recorded", finished):
                    self.finished = self.finished or finished
                case ("left",):
                    self.is_detached = True
                case ("over", has_fault, had_robot):
                    self.is_detached = self.is_over = True
                    self.has_fault, self.had_robot = has_fault, had_robot
                case ("failed", error):
                    self.is_detached = self.is_over = True
                    raise error
        except PipeClosedError:
            raise RecordError("the process of the trial ended unexpectedly") from None
        return tuple(received)

    def relay(self, wire: Wire) -> None:
        """Relay messages between a client and the server until the client disconnects."""

        def forward() -> None:
            while (message := wire.inbox.get()) is not None:
                self.send(message)
            self.send(None)

        Thread(target=forward, daemon=True).start()
        while not self.is_detached:
            word, *rest = self.receive()
            if word == "says":
                wire.send(rest[0])

    def finish(self) -> None:
        """Run the trial to its end without a debugger."""
        while not self.is_over:
            self.receive()

    def close(self) -> None:
        """End the trial and its process."""
        self._checkpoints.discard_after(-1)
        self._pipe.close()
        self._process.join(PATIENCE_S)

    @property
    def process_id(self) -> int:
        """Process in which the trial was started; it ends when a checkpoint continues instead."""
        assert self._process.pid is not None
        return self._process.pid

    @property
    def checkpoint_count(self) -> int:
        """Number of checkpoints that exist now."""
        return len(self._checkpoints)

    def has_received(self, count: int) -> bool:
        """Whether `count` is the number of messages that the client has sent."""
        return count == self._sent

    def is_ready(self, wait: float) -> bool:
        """Whether a tuple from the trial's process has arrived, or arrives within `wait` seconds."""
        return self._pipe.is_ready(wait)

    def _rewind(self, cycle: int, count: int) -> None:
        """Continue from the latest checkpoint before `cycle`; the server has received `count` messages."""
        self._checkpoints.discard_after(cycle)
        while (checkpoint := self._checkpoints.latest_before(cycle)) is not None:
            self._checkpoints.remove(checkpoint)
            with suppress(PipeClosedError):
                checkpoint.pipe.send(("fork",))
                fork = checkpoint.pipe.receive()[1]
                if fork is not None:
                    self._checkpoints.add(checkpoint._replace(pipe=fork))
                break
        with self._lock:
            self._pipe.send((checkpoint is not None,))
            if checkpoint is None:
                return
            (_, state, pending), _ = self._pipe.receive()
            abandoned, self._pipe = self._pipe, checkpoint.pipe
            self._pipe.send(("resume", state, count))
            for message in pending:
                self._pipe.send(message)
        abandoned.close()


class RemoteServer:
    """Server of a session's trial for a client in this process that waits for each response (`emu.prompt`)."""

    def __init__(self, session: DebugSession, client: Channel) -> None:
        self._session: Final = session
        self._client: Final = client

    @property
    def is_over(self) -> bool:
        """Whether the client has disconnected."""
        return self._session.is_detached

    def handle_request(self, message: Message) -> None:
        """Send one request and return when the machine is paused again.

        Messages that the client puts into its inbox meanwhile are sent too."""
        session, inbox = self._session, self._client.inbox
        session.send(message)
        while not session.is_detached:
            if not session.is_ready(POLL_S):
                while not inbox.empty():
                    session.send(inbox.get())
                continue
            word, *rest = session.receive()
            if word == "says":
                self._client.send(rest[0])
            elif word == "waits" and session.has_received(rest[0]):
                return

    def release(self) -> None:
        """Do nothing: the server detaches from the robot by itself."""
