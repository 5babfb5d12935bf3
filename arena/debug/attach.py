"""A robot of a studio's trial in the hands of a debugger: a server of the Debug Adapter Protocol on a port of this
machine, from the present moment on, for one client.

While the client looks, the world stands, and the studio still answers whoever looks at its page (`idle`). The past of
the robot can be looked at from that moment on; changed is the present only, since the others have seen what came of it.
"""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Final

from arena.debug.controlled_robot import Debugged, Recording
from arena.replay.http import HERE
from emu.dap.server import Server
from emu.dap.wire import Message, Wire, wire_over
from emu.machine.machine import Machine

LOOK_S: Final = 0.01
"""How long the studio may wait for somebody before it is looked whether the client has said something."""
PAST: Final = "this is the past, and the other robots have seen what came of it: go back to the present to change it"


class _Present(Recording):
    """A robot's history whose present alone can be changed."""

    @property
    def frozen(self) -> str:
        return PAST if self.is_past else ""


class _Inbox(SimpleQueue[Message | None]):
    """Messages of a client, waited for as the studio waits for what it is asked. Nothing more comes once it has
    `ended`."""

    def __init__(self, wire: Wire, idle: Callable[[float], bool]) -> None:
        self._from: Final = wire.inbox
        self._idle: Final = idle

    def empty(self) -> bool:
        return self._from.empty() and self._idle(0)

    def get(self, block: bool = True, timeout: float | None = None) -> Message | None:
        while self._idle(LOOK_S):
            with suppress(Empty):
                return self._from.get_nowait()
        return None


class _Channel:
    """A wire whose inbox lets the studio live."""

    def __init__(self, wire: Wire, idle: Callable[[float], bool]) -> None:
        self.inbox: Final = _Inbox(wire, idle)
        self.send: Final = wire.send


class Handed(Debugged):
    """Robot number `robot`, given to whoever connects to `port`. `idle(s)` answers what the studio is asked for
    within so many seconds; false: it is time to give the robot back. Raises OSError if there is no port."""

    def __init__(self, robot: int, idle: Callable[[float], bool]) -> None:
        super().__init__(robot, lambda _debugged: self._serve(), keeps=False)
        self.robot: Final = robot
        self._idle: Final = idle
        self._listening: Final = socket.create_server((HERE, 0))
        self._listening.setblocking(False)
        self.port: Final[int] = self._listening.getsockname()[1]
        self.is_met = False
        """A client is there."""
        self.is_back = False
        """The robot was given back."""

    def record(self, machine: Machine) -> Recording:
        """As of any debugged robot, but that the trial is not begun again for it."""
        self._recording = _Present(self, machine)
        return self._recording

    def _serve(self) -> bool:
        try:
            while self._idle(LOOK_S):
                with suppress(BlockingIOError):
                    connection, _ = self._listening.accept()
                    break
            else:
                return True
            self._listening.close()
            connection.setblocking(True)
            self.is_met = True
            with wire_over(connection) as wire:
                Server(_Channel(wire, self._idle), lambda _arguments: self.machine, self.record).serve()
        finally:
            self.close()
        return True

    def close(self) -> None:
        """Nobody can connect any more."""
        self.is_back = True
        self._listening.close()
