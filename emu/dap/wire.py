"""Messages of the Debug Adapter Protocol on two byte streams: a Content-Length header, a blank line, JSON."""

from __future__ import annotations

import json
import os
import re
import select
import threading
from queue import SimpleQueue
from typing import Any, BinaryIO, Final, Protocol

HEADER: Final = re.compile(rb"content-length:[ \t]*(\d{1,9})", re.IGNORECASE)
READ_SIZE: Final = 1 << 16
LOOK_SECONDS: Final = 0.1
"""How long the reading thread may take to notice that it should end."""
LONGEST: Final = 1 << 24
"""Bytes of a message; a longer one is not one."""

Message = dict[str, Any]


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
        while (message := self._read()) is not None:
            self.inbox.put(message)
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
        while (end := self._unread.find(b"\r\n\r\n")) < 0:
            if len(self._unread) > LONGEST or not self._more():
                return None
        header = HEADER.search(self._unread, 0, end)
        size = int(header[1]) if header is not None else 0
        if not 0 < size <= LONGEST:
            return None
        while len(self._unread) < end + 4 + size:
            if not self._more():
                return None
        body = bytes(self._unread[end + 4 : end + 4 + size])
        del self._unread[: end + 4 + size]
        try:
            message = json.loads(body)
        except (ValueError, RecursionError):
            return None
        return message if isinstance(message, dict) else None
