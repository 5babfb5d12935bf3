"""A client of a debug server that waits for it: what is asked is answered, and what it lets go has halted, when a call
comes back."""

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


class RefusedError(Exception):
    """What was asked for cannot be done; the text is for the user."""


class Answering(Protocol):
    """A server, here or in another process: `emu.dap.server.Server`."""

    @property
    def is_over(self) -> bool:
        """The client has left."""

    def answer(self, message: Message) -> None:
        """Respond to one request; comes back when the machine stands again."""

    def leave(self) -> None:
        """Give back what was debugged."""


class Client:
    """Owns what `serving` makes, a server that talks to it; `say(text)` gets what the firmware and the server say."""

    def __init__(self, serving: Callable[[Channel], Answering], say: Callable[[str], None]) -> None:
        self.inbox: Final[SimpleQueue[Message | None]] = SimpleQueue()
        self.server: Final = serving(self)
        self._say: Final = say
        self._seq = 0
        self._reply: Message = {}
        self._halt: Row = {}
        self.said = ""
        """What the last of `go` was answered, if it was a text."""

    def send(self, message: Message) -> None:
        """What the server says."""
        if message["type"] == "response":
            if message["request_seq"] == self._seq:
                self._reply = message
        elif message["event"] == "output":
            self._say(message["body"]["output"])
        elif message["event"] == "stopped":
            self._halt = message["body"]

    def ask(self, command: str, **arguments: Any) -> Row:
        """The body of the response. Raises RefusedError."""
        self._seq += 1
        with self._interruptible():
            self.server.answer({"type": "request", "seq": self._seq, "command": command, "arguments": arguments})
        if not self._reply["success"]:
            raise RefusedError(self._reply["message"])
        body: Row = self._reply["body"]
        return body

    def go(self, command: str, **arguments: Any) -> Row:
        """Where a request that lets the machine go has led: the body of the halt. Raises RefusedError."""
        self._halt = {}
        self.said = str(self.ask(command, **arguments).get("result", ""))
        return self._halt

    @contextmanager
    def _interruptible(self) -> Iterator[None]:
        """The key for an interrupt makes the machine stand, not the program end."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        pause = {"type": "request", "seq": 0, "command": "pause"}
        before = signal.signal(signal.SIGINT, lambda *_: self.inbox.put(pause))
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)
            while not self.inbox.empty():  # it halted by itself at that moment
                self.inbox.get()
