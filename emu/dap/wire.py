"""Messages of the Debug Adapter Protocol on two byte streams: a Content-Length header, a blank line, JSON."""

from __future__ import annotations

import json
import os
import re
import select
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from queue import SimpleQueue
from typing import Any, BinaryIO, Final, Protocol

HEADER: Final = re.compile(rb"content-length:[ \t]*(\d{1,20})", re.IGNORECASE)
READ_SIZE: Final = 1 << 16
LOOK_SECONDS: Final = 0.1
"""How long the reading thread may take to notice that it should end."""
LONGEST: Final = 1 << 24
"""Bytes of a message; a longer one is not one."""
SHOWN: Final = 60
"""Bytes of what is no message that are told."""

Message = dict[str, Any]


class _NoMessage(Exception):
    """What came is none of the protocol's; the text says why."""


class Channel(Protocol):
    """What a server talks over: messages that came, None at the end, and a way to send some."""

    @property
    def inbox(self) -> SimpleQueue[Message | None]:
        """What the client has sent."""

    def send(self, message: Message) -> None:
        """To the client."""


class Wire:
    """Writes messages at once; reads them in a thread of its own into `inbox`, None at the end.

    `source` is a file descriptor to read from."""

    def __init__(self, source: int, writer: BinaryIO) -> None:
        self._source: Final = source
        self._writer: Final = writer
        self._seq = 0
        self._unread = bytearray()
        self._closed = False
        self.problem = ""
        """What was wrong with what the client sent, so that nothing more was read; empty if it just ended."""
        self.inbox: Final[SimpleQueue[Message | None]] = SimpleQueue()
        self._listener: Final = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def close(self) -> None:
        """Read no more; comes back when the reading thread has ended."""
        self._closed = True
        self._listener.join()

    def send(self, message: Message) -> None:
        """Write one message; its `seq` is filled in. A client that has gone is not told."""
        self._seq += 1
        body = json.dumps({"seq": self._seq, **message}).encode()
        try:
            self._writer.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
            self._writer.flush()
        except (OSError, ValueError):
            self.inbox.put(None)

    def _listen(self) -> None:
        try:
            while (message := self._read()) is not None:
                self.inbox.put(message)
        except _NoMessage as problem:  # what follows cannot be told apart any more
            self.problem = "" if self._closed else str(problem)
        self.inbox.put(None)

    def _more(self) -> bool:
        """Wait for bytes; false when there will be none."""
        while not self._closed:
            try:
                if select.select([self._source], [], [], LOOK_SECONDS)[0]:
                    data = os.read(self._source, READ_SIZE)
                    self._unread += data
                    return bool(data)
            except (OSError, ValueError):
                return False
        return False

    def _read(self) -> Message | None:
        """The next one, None at the end. Raises _NoMessage."""
        while (end := self._unread.find(b"\r\n\r\n")) < 0:
            if len(self._unread) > LONGEST:
                raise _NoMessage(f"{LONGEST} bytes without an end of the header of a message")
            if not self._more():
                if self._unread.strip():
                    raise _NoMessage("it ends in the header of a message")
                return None
        header = HEADER.search(self._unread, 0, end)
        if header is None:
            raise _NoMessage(f"expected `Content-Length: N` before a message, not {_shown(self._unread[:end])}")
        size = int(header[1])
        if not 0 < size <= LONGEST:
            raise _NoMessage(f"a message of {size} bytes; expected 1 to {LONGEST}")
        while len(self._unread) < end + 4 + size:
            if not self._more():
                raise _NoMessage(f"it ends behind {len(self._unread) - end - 4} of {size} bytes of a message")
        body = bytes(self._unread[end + 4 : end + 4 + size])
        del self._unread[: end + 4 + size]
        try:
            message = json.loads(body)
        except (ValueError, RecursionError):
            raise _NoMessage(f"a message that is no JSON: {_shown(body)}") from None
        if not isinstance(message, dict):
            raise _NoMessage(f"a message that is no object: {_shown(body)}")
        return message


def _shown(data: bytes | bytearray) -> str:
    """Its beginning."""
    return repr(bytes(data[:SHOWN]))[1:] + ("..." if len(data) > SHOWN else "")


@contextmanager
def wire_over(connection: socket.socket) -> Iterator[Wire]:
    """A wire over a connection, which is closed at the end, also if the client has gone before it was told all."""
    writer = connection.makefile("wb")
    wire = Wire(connection.fileno(), writer)
    try:
        yield wire
    finally:
        wire.close()
        with suppress(OSError):
            writer.close()
        connection.close()
