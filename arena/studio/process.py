"""Client of a `TrialSession`: starts its process, sends commands and keeps its checkpoints.

A rewind resumes the checkpoint with the latest time before its target, and the checkpoint replays the missing part.
Without a checkpoint, the session replays the trial from its seed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from threading import Lock
from typing import Any, Final, NamedTuple

from arena.campaign.campaign import Plan
from arena.studio.errors import CommandRefusedError
from arena.trial.checkpoints import PATIENCE_S, Checkpoint, CheckpointPool, PipeClosedError, PipeEnd, context, pipe


class Call(NamedTuple):
    """A command for the session: the name of a method of `TrialSession`, and its arguments."""

    name: str
    arguments: tuple[Any, ...] = ()
    named: Mapping[str, Any] = {}


class Reply(NamedTuple):
    """Results of a batch of commands, the pipe that came with them, and the time of the trial at the reply."""

    results: list[Any]
    end: PipeEnd | None
    tick: int
    seconds: float
    allows_checkpoint: bool


class Studio:
    """Process that runs trial `seed` of `plan`, paused at its start. All methods may be called from any thread.

    `on_process` is called when the process exists, which then creates the trial. Raises SceneError or emu.LoadError if
    the trial cannot be created.
    """

    def __init__(self, plan: Plan, seed: int, on_process: Callable[[], None] = lambda: None) -> None:
        from arena.studio.session import serve  # imported late: a server answers before this

        self._lock: Final = Lock()
        self._checkpoints: Final = CheckpointPool()
        self._pipe, there = pipe()
        self._process: Final = context().Process(target=serve, args=(there.end, plan, seed), daemon=True)
        self._process.start()
        there.drop()
        on_process()
        self._receive(self._pipe)

    def ask(self, name: str, *arguments: Any, **named: Any) -> Any:
        """Execute one command and return its result.

        The session executes it between two quanta, or while a robot is at a breakpoint. Raises what the command raises,
        and CommandRefusedError if the studio is closed."""
        return self.ask_all(Call(name, arguments, named))[0]

    def ask_all(self, *calls: Call) -> list[Any]:
        """Execute several commands without another one in between, and return their results."""
        with self._lock:
            try:
                reply = (calls[0].name == "rewind" and self._resume_checkpoint(calls)) or self._send(self._pipe, calls)
                if reply.allows_checkpoint and self._checkpoints.is_due(reply.seconds):
                    self._take_checkpoint()
            except PipeClosedError:
                raise CommandRefusedError("the studio is closed") from None
            return reply.results

    def close(self) -> None:
        """End the trial and its process."""
        with self._lock:
            self._checkpoints.discard_after(-1)
            self._pipe.close()
            self._process.join(PATIENCE_S)

    @property
    def checkpoint_count(self) -> int:
        """Number of checkpoints that exist now."""
        return len(self._checkpoints)

    def _send(self, to: PipeEnd, calls: Sequence[Call]) -> Reply:
        to.send([tuple(call) for call in calls])
        return self._receive(to)

    def _receive(self, source: PipeEnd) -> Reply:
        (error, *about), end = source.receive()
        if error is not None:
            raise error
        return Reply(about[0], end, *about[1])

    def _take_checkpoint(self) -> None:
        reply = self._send(self._pipe, [Call("checkpoint")])
        if reply.end is not None:
            self._checkpoints.add(Checkpoint(reply.tick, reply.seconds, reply.end))

    def _resume_checkpoint(self, calls: Sequence[Call]) -> Reply | None:
        """Execute `calls`, of which the first is `rewind`, in the latest checkpoint before the target.

        Return None, without executing them, if the target is not in the past or there is no checkpoint."""
        target = (*calls[0].arguments, *calls[0].named.values())[0]
        (state,) = self._send(self._pipe, [Call("rewind_state", (target,))]).results
        if state is None:
            return None
        self._checkpoints.discard_after(target)
        while (checkpoint := self._checkpoints.latest_before(target)) is not None:
            self._checkpoints.remove(checkpoint)
            with suppress(PipeClosedError):
                reply = self._send(checkpoint.pipe, [Call("checkpoint", (state,))])
                break
        else:
            return None
        abandoned, self._pipe = self._pipe, checkpoint.pipe
        abandoned.close()
        if reply.end is not None:
            self._checkpoints.add(checkpoint._replace(pipe=reply.end))
        reply = self._send(self._pipe, calls[1:])
        return reply._replace(results=[None, *reply.results])
