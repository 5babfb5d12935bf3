"""Synchronous client of a debug server. A call returns when the request is answered and the machine is paused."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Final, Protocol

if TYPE_CHECKING:
    from emu.dap.wire import Channel, Message

Row = dict[str, Any]


class CommandRefusedError(Exception):
    """The server has refused a command. The text is shown to the user."""


class DebugServer(Protocol):
    """Debug server in this or another process, for example `emu.dap.server.Server`."""

    @property
    def is_over(self) -> bool:
        """Whether the client has disconnected."""

    def handle_request(self, message: Message) -> None:
        """Respond to one request, and return when the machine is paused."""

    def release(self) -> None:
        """Detach from the debuggee."""


class Client:
    """Client of the server created by `make_server`. `say(text)` prints output of the firmware and the server."""

    def __init__(self, make_server: Callable[[Channel], DebugServer], say: Callable[[str], None]) -> None:
        self.inbox: Final[SimpleQueue[Message | None]] = SimpleQueue()
        self.server: Final = make_server(self)
        self._say: Final = say
        self._seq = 0
        self._reply: Message = {}
        self._stop_event: Row = {}
        self.result_text = ""
        """Text of the response to the last `resume`; empty if it had none."""

    def send(self, message: Message) -> None:
        """Handle a message from the server."""
        if message["type"] == "response":
            if message["request_seq"] == self._seq:
                self._reply = message
        elif message["event"] == "output":
            self._say(message["body"]["output"])
        elif message["event"] == "stopped":
            self._stop_event = message["body"]

    def ask(self, command: str, **arguments: Any) -> Row:
        """Send a request and return the response's body. Raises CommandRefusedError."""
        self._seq += 1
        with self._interruptible():
            self.server.handle_request(
                {"type": "request", "seq": self._seq, "command": command, "arguments": arguments}
            )
        if not self._reply["success"]:
            raise CommandRefusedError(self._reply["message"])
        body: Row = self._reply["body"]
        return body

    def resume(self, command: str, **arguments: Any) -> Row:
        """Send a request that runs, steps or rewinds the machine. Return the stop event's body.

        Raises CommandRefusedError.
        """
        self._stop_event = {}
        self.result_text = str(self.ask(command, **arguments).get("result", ""))
        return self._stop_event

    @contextmanager
    def _interruptible(self) -> Iterator[None]:
        """Make Ctrl-C pause the machine inside the block instead of ending the program."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        pause = {"type": "request", "seq": 0, "command": "pause"}
        before = signal.signal(signal.SIGINT, lambda *_: self.inbox.put(pause))
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)
            while not self.inbox.empty():  # the machine may have stopped just before Ctrl-C
                self.inbox.get()
