"""Debugger on one robot of a running studio trial: a Debug Adapter Protocol server on a TCP port, for one client.

The debugger starts at the present time of the trial. While the client inspects the robot, the world is paused, and the
studio continues to execute commands (`poll`). The client can go back to the time at which the debugger was attached. It
can change the robot in the present only, because the other robots have already reacted to its past.
"""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Final

from arena.debug.controlled_robot import ControlledRobot
from arena.debug.robot_history import RobotHistory
from arena.replay.http import LOOPBACK
from emu.dap.server import Server
from emu.dap.wire import Message, Wire, wire_over
from emu.host.local_server import is_own_client
from emu.machine.machine import Machine

POLL_S: Final = 0.01
"""Longest time, in seconds, that the studio waits for commands between two looks at the client's messages."""
PAST: Final = "this is the past, and the other robots have seen what came of it: go back to the present to change it"


class _PollingInbox(SimpleQueue[Message | None]):
    """Messages of a client. While `get` waits, the studio executes commands; None once the studio ends the session."""

    def __init__(self, wire: Wire, poll: Callable[[float], bool]) -> None:
        self._source: Final = wire.inbox
        self._poll: Final = poll

    def empty(self) -> bool:
        return self._source.empty() and self._poll(0)

    def get(self, block: bool = True, timeout: float | None = None) -> Message | None:
        while self._poll(POLL_S):
            with suppress(Empty):
                return self._source.get_nowait()
        return None


class _PollingChannel:
    """Channel to a client. While it waits for a message, the studio executes commands."""

    def __init__(self, wire: Wire, poll: Callable[[float], bool]) -> None:
        self.inbox: Final = _PollingInbox(wire, poll)
        self.send: Final = wire.send


class AttachedRobot(ControlledRobot):
    """Robot number `robot` of a studio trial, controlled by the client that connects to `port`.

    `poll(s)` executes commands of the studio for at most `s` seconds; it returns false to detach the debugger. Raises
    OSError if no TCP port is available.
    """

    def __init__(self, robot: int, poll: Callable[[float], bool]) -> None:
        super().__init__(robot, lambda _controlled: self._serve(), is_recorded=False)
        self.robot: Final = robot
        self._poll: Final = poll
        self._listener: Final = socket.create_server((LOOPBACK, 0))
        self._listener.setblocking(False)
        self.port: Final[int] = self._listener.getsockname()[1]
        self.is_connected = False
        """Whether a client has connected."""
        self.is_closed = False
        """Whether the debugger has been detached."""

    def record(self, machine: Machine) -> RobotHistory:
        """Create the history of the robot; the world cannot go back with it."""
        self._history = self._new_history(machine)
        return self._history

    def read_only(self, is_past: bool) -> str:
        """As `ControlledRobot.read_only`: the robot can be changed in its present only."""
        return PAST if is_past else ""

    def _serve(self) -> bool:
        try:
            while self._poll(POLL_S):
                with suppress(BlockingIOError):
                    connection, _ = self._listener.accept()
                    if is_own_client(connection):
                        break
                    connection.close()
            else:
                return True
            self._listener.close()
            connection.setblocking(True)
            self.is_connected = True
            with wire_over(connection) as wire:
                Server(_PollingChannel(wire, self._poll), lambda _arguments: self.machine, self.record).serve()
        finally:
            self.close()
        return True

    def close(self) -> None:
        """Detach the debugger: refuse further connections."""
        self.is_closed = True
        self._listener.close()
