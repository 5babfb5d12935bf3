"""Checkpoints of a trial process: forked copies, each blocked on a pipe until it is resumed.

A copy made by `fork` is the process at that instant, to the byte, with the hidden state of its libraries. It costs the
memory in which it differs from the processes that continue. Closing a pipe ends the process at its other end.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import select
import socket
import struct
import sys
from contextlib import suppress
from multiprocessing.context import ForkServerContext, SpawnContext
from typing import Any, Final, NamedTuple

CAN_FORK: Final = sys.platform == "linux"
"""Whether processes can be forked. On other systems some libraries of the system do not survive a fork."""
MAX_CHECKPOINTS: Final = 10
"""Greatest number of checkpoints."""
EVERY_S: Final = 10.0
"""Simulated seconds between new checkpoints; `CheckpointPool.add` thins out older ones."""
PATIENCE_S: Final = 5.0
"""Seconds to wait for a process to end."""
_HEAD: Final = struct.Struct("<Q")
"""Head of a message: the length of the rest in bytes."""


class PipeClosedError(ConnectionError):
    """The other end of a pipe was closed."""


class PipeEnd:
    """One end of a pipe between two processes. It transports objects, and ends of other pipes."""

    def __init__(self, end: socket.socket) -> None:
        self.end: Final = end

    def send(self, what: Any, end: PipeEnd | None = None) -> None:
        """Send an object, and optionally an end of another pipe. Raises PipeClosedError."""
        body = pickle.dumps(what)
        head = _HEAD.pack(len(body))
        try:
            if end is None:
                self.end.sendall(head)
            else:
                socket.send_fds(self.end, [head], [end.fileno()])
            self.end.sendall(body)
        except OSError as error:
            raise PipeClosedError(str(error)) from None

    def receive(self) -> tuple[Any, PipeEnd | None]:
        """Return the next object and the end that came with it. Raises PipeClosedError."""
        try:
            head, ends, _, _ = socket.recv_fds(self.end, _HEAD.size, 1)
            end = socket.socket(fileno=ends[0]) if ends else None
            (size,) = _HEAD.unpack(head + self._exactly(_HEAD.size - len(head)))
            body = self._exactly(size)
        except OSError as error:
            raise PipeClosedError(str(error)) from None
        if end is not None:
            end.set_inheritable(False)
        return pickle.loads(body), PipeEnd(end) if end is not None else None

    def _exactly(self, count: int) -> bytes:
        """Read `count` bytes. Raises PipeClosedError."""
        parts = []
        while count:
            parts.append(self.end.recv(min(count, 1 << 20)))
            if not parts[-1]:
                raise PipeClosedError("closed")
            count -= len(parts[-1])
        return b"".join(parts)

    def is_ready(self, wait: float) -> bool:
        """Whether data, or the end of data, is available within `wait` seconds."""
        return bool(select.select([self.end], [], [], wait)[0])

    def fileno(self) -> int:
        """Return the file descriptor."""
        return self.end.fileno()

    def close(self) -> bool:
        """Close the pipe and wait for the process at the other end. Return whether it has ended."""
        with self.end as end, suppress(TimeoutError):
            with suppress(ConnectionError):
                end.shutdown(socket.SHUT_WR)
                end.settimeout(PATIENCE_S)
                while end.recv(1 << 16):
                    pass
            return True
        return False

    def drop(self) -> None:
        """Close this process's descriptor; another process has the same end."""
        self.end.close()


def pipe() -> tuple[PipeEnd, PipeEnd]:
    """Return both ends of a new pipe."""
    one, other = socket.socketpair()
    return PipeEnd(one), PipeEnd(other)


def context() -> SpawnContext | ForkServerContext:
    """Return the multiprocessing context for a process that forks checkpoints later: it starts with a single thread."""
    if not CAN_FORK:
        return multiprocessing.get_context("spawn")
    made = multiprocessing.get_context("forkserver")
    made.set_forkserver_preload(["arena.studio.session", "arena.robots.firmware_controller"])
    return made


class ProcessForker:
    """Forks the process it is in, and reaps the copies that have ended."""

    def __init__(self) -> None:
        self._children: list[int] = []

    def fork(self) -> tuple[PipeEnd, bool]:
        """Fork this process and return an end of a pipe between both, and whether this is the copy. Raises OSError."""
        self._children = [one for one in self._children if os.waitpid(one, os.WNOHANG)[0] == 0]
        here, there = pipe()
        child = os.fork()
        if child:
            there.drop()
            self._children.append(child)
            return here, False
        here.drop()
        self._children = []
        return there, True


class Checkpoint(NamedTuple):
    """A blocked copy of the trial process."""

    tick: int
    seconds: float
    pipe: PipeEnd


class CheckpointPool:
    """The checkpoints of one trial, the oldest first."""

    def __init__(self) -> None:
        self._checkpoints: Final[list[Checkpoint]] = []

    def __len__(self) -> int:
        return len(self._checkpoints)

    def is_due(self, seconds: float) -> bool:
        """Whether EVERY_S has passed since the newest checkpoint, or since the start."""
        return seconds - (self._checkpoints[-1].seconds if self._checkpoints else 0.0) >= EVERY_S

    def add(self, checkpoint: Checkpoint) -> None:
        """Add a checkpoint. If there are too many, end the one whose gap is smallest for its age, so that older
        checkpoints are further apart."""
        self._checkpoints.append(checkpoint)
        if len(self._checkpoints) > MAX_CHECKPOINTS:
            times = [0.0, *(one.seconds for one in self._checkpoints)]
            now = times[-1]
            gaps = [(times[i + 1] - times[i - 1]) / (now - times[i]) for i in range(1, len(times) - 1)]
            self._checkpoints.pop(gaps.index(min(gaps))).pipe.close()

    def latest_before(self, tick: int) -> Checkpoint | None:
        """Return the latest checkpoint that is not after `tick`."""
        return next((one for one in reversed(self._checkpoints) if one.tick <= tick), None)

    def remove(self, checkpoint: Checkpoint) -> None:
        """Remove a checkpoint whose process was resumed."""
        self._checkpoints.remove(checkpoint)

    def discard_after(self, tick: int) -> None:
        """End the processes of the checkpoints later than `tick`."""
        while self._checkpoints and self._checkpoints[-1].tick > tick:
            self._checkpoints.pop().pipe.close()
