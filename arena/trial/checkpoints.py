"""Moments of a process that are kept, to go on from: copies of it, each at the other end of a line, asleep.

A copy made by `fork` is the process at that instant, to the byte, with what libraries keep where nobody else can reach
it. It costs the memory in which it differs from those that went on. A line that is closed ends whoever is at its end.
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

CAN_COPY: Final = sys.platform == "linux"
"""Elsewhere the system's own libraries do not all survive a fork."""
KEPT: Final = 10
"""Moments that are kept at most."""
EVERY_S: Final = 10.0
"""Simulated seconds from one moment to the next, while they are new."""
PATIENCE_S: Final = 5.0
"""For which a process is waited for that is to end."""
_HEAD: Final = struct.Struct("<Q")


class PipeClosedError(ConnectionError):
    """The other end of a line was closed."""


class PipeEnd:
    """One end of a line between two processes, along which go objects, and ends of other lines."""

    def __init__(self, end: socket.socket) -> None:
        self.end: Final = end

    def send(self, what: Any, end: PipeEnd | None = None) -> None:
        """Raises PipeClosedError."""
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
        """The next object, and the end that came with it. Raises PipeClosedError."""
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
        parts = []
        while count:
            parts.append(self.end.recv(min(count, 1 << 20)))
            if not parts[-1]:
                raise PipeClosedError("closed")
            count -= len(parts[-1])
        return b"".join(parts)

    def is_ready(self, wait: float) -> bool:
        """Whether something has come, or comes within so many seconds; also that it was closed."""
        return bool(select.select([self.end], [], [], wait)[0])

    def fileno(self) -> int:
        return self.end.fileno()

    def close(self) -> bool:
        """End whoever is at the other end; whether it has ended."""
        with self.end as end, suppress(TimeoutError):
            with suppress(ConnectionError):
                end.shutdown(socket.SHUT_WR)
                end.settimeout(PATIENCE_S)
                while end.recv(1 << 16):
                    pass
            return True
        return False

    def drop(self) -> None:
        """Close it here; another process has it too."""
        self.end.close()


def pipe() -> tuple[PipeEnd, PipeEnd]:
    """Both ends of a new line."""
    one, other = socket.socketpair()
    return PipeEnd(one), PipeEnd(other)


def context() -> SpawnContext | ForkServerContext:
    """How a process is begun that can be copied: it must have no other threads."""
    if not CAN_COPY:
        return multiprocessing.get_context("spawn")
    made = multiprocessing.get_context("forkserver")
    made.set_forkserver_preload(["arena.studio.session", "arena.robots.firmware_controller"])
    return made


class ProcessForker:
    """In the process that is copied: the copies that are its children."""

    def __init__(self) -> None:
        self._children: list[int] = []

    def make(self) -> tuple[PipeEnd, bool]:
        """Copy this process. Comes back twice: in this one with the line to the copy and false, in the copy with its
        own end and true. Raises OSError."""
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
    """A copy that sleeps."""

    tick: int
    seconds: float
    pipe: PipeEnd


class CheckpointPool:
    """The moments of one trial, the oldest first."""

    def __init__(self) -> None:
        self._moments: Final[list[Checkpoint]] = []

    def __len__(self) -> int:
        return len(self._moments)

    def is_due(self, seconds: float) -> bool:
        """Whether that time is far enough from the newest moment, or the beginning."""
        return seconds - (self._moments[-1].seconds if self._moments else 0.0) >= EVERY_S

    def add(self, moment: Checkpoint) -> None:
        """Keep it. If there are too many then, the one goes that leaves the smallest gap, for its age: what is long ago
        is kept more coarsely."""
        self._moments.append(moment)
        if len(self._moments) > KEPT:
            times = [0.0, *(one.seconds for one in self._moments)]
            now = times[-1]
            gaps = [(times[i + 1] - times[i - 1]) / (now - times[i]) for i in range(1, len(times) - 1)]
            self._moments.pop(gaps.index(min(gaps))).pipe.close()

    def before(self, tick: int) -> Checkpoint | None:
        """The latest that is not after `tick`."""
        return next((one for one in reversed(self._moments) if one.tick <= tick), None)

    def pop(self, moment: Checkpoint) -> None:
        """It is awake now."""
        self._moments.remove(moment)

    def forget(self, tick: int) -> None:
        """What was after `tick` will never be."""
        while self._moments and self._moments[-1].tick > tick:
            self._moments.pop().pipe.close()
