"""Framing of Debug Adapter Protocol messages on byte streams: a Content-Length header, a blank line, JSON."""

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

LENGTH: Final = re.compile(rb"content-length:[ \t]*(\d{1,20})[ \t]*", re.IGNORECASE)
OTHER_FIELD: Final = re.compile(rb"content-type:[ \t]*[\x21-\x7e \t]*", re.IGNORECASE)
"""Header field that is accepted besides Content-Length and ignored."""
HTTP_REQUEST: Final = re.compile(rb"[A-Za-z]{1,20} [^ \r\n]{1,8000}(?: HTTP/|$)")
MAX_HEADER_BYTES: Final = 4096
READ_SIZE: Final = 1 << 16
POLL_SECONDS: Final = 0.1
"""Interval in s at which the reader thread checks whether it must end."""
MAX_MESSAGE_BYTES: Final = 1 << 24
"""Maximum size of a message in bytes; a larger size is a protocol error."""
EXCERPT_BYTES: Final = 60
"""Maximum number of bytes of an invalid message that an error shows."""

Message = dict[str, Any]


class _ProtocolError(Exception):
    """The received bytes are not a valid message. The text gives the reason."""


class Channel(Protocol):
    """Connection between a server and its client."""

    @property
    def inbox(self) -> SimpleQueue[Message | None]:
        """Messages received from the client, then None when the connection has ended."""

    def send(self, message: Message) -> None:
        """Send a message to the client."""


class Wire:
    """Connection over byte streams. A reader thread puts received messages into `inbox`, then None at the stream's end.

    `source` is the file descriptor from which the thread reads.
    """

    def __init__(self, source: int, writer: BinaryIO) -> None:
        self._source: Final = source
        self._writer: Final = writer
        self._seq = 0
        self._unread = bytearray()
        self._closed = False
        self.problem = ""
        """Description of the protocol error that ended the connection; empty after a regular end."""
        self.inbox: Final[SimpleQueue[Message | None]] = SimpleQueue()
        self._listener: Final = threading.Thread(target=self._read_messages, daemon=True)
        self._listener.start()

    def close(self) -> None:
        """Stop reading and wait for the reader thread to end."""
        self._closed = True
        self._listener.join()

    def send(self, message: Message) -> None:
        """Write one message and fill in its `seq`.

        If the client has disconnected, discard it and end the inbox with None.
        """
        self._seq += 1
        body = json.dumps({"seq": self._seq, **message}).encode()
        try:
            self._writer.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
            self._writer.flush()
        except (OSError, ValueError):
            self.inbox.put(None)

    def _read_messages(self) -> None:
        try:
            while (message := self._read()) is not None:
                self.inbox.put(message)
        except _ProtocolError as problem:  # the start of the next message is unknown after an error, so reading ends
            self.problem = "" if self._closed else str(problem)
        self.inbox.put(None)

    def _receive(self) -> bool:
        """Wait for bytes. Return False at the end of the stream."""
        while not self._closed:
            try:
                if select.select([self._source], [], [], POLL_SECONDS)[0]:
                    data = os.read(self._source, READ_SIZE)
                    self._unread += data
                    return bool(data)
            except (OSError, ValueError):
                return False
        return False

    def _read(self) -> Message | None:
        """Return the next message, None at the end of the stream. Raises _ProtocolError."""
        while (end := self._unread.find(b"\r\n\r\n")) < 0:
            if len(self._unread) > MAX_HEADER_BYTES:
                _refuse_http(bytes(self._unread[:MAX_HEADER_BYTES]))
                raise _ProtocolError(f"{MAX_HEADER_BYTES} bytes without the end of a message header")
            if not self._receive():
                if self._unread.strip():
                    raise _ProtocolError("the input ends in a message header")
                return None
        size = _message_size(bytes(self._unread[:end]))
        while len(self._unread) < end + 4 + size:
            if not self._receive():
                raise _ProtocolError(f"the input ends after {len(self._unread) - end - 4} of {size} bytes of a message")
        body = bytes(self._unread[end + 4 : end + 4 + size])
        del self._unread[: end + 4 + size]
        try:
            message = json.loads(body)
        except (ValueError, RecursionError):
            raise _ProtocolError(f"a message is not valid JSON: {_excerpt(body)}") from None
        if not isinstance(message, dict):
            raise _ProtocolError(f"a message is no JSON object: {_excerpt(body)}")
        return message


def _refuse_http(header: bytes) -> None:
    """Raise _ProtocolError if a header begins with an HTTP request line."""
    if HTTP_REQUEST.match(header):
        raise _ProtocolError("an HTTP request, perhaps from a web page; this port is for editors (Debug Adapter "
                             f"Protocol) only: {_excerpt(header)}")  # fmt: skip


def _message_size(header: bytes) -> int:
    """Return the message size given by a header. Raises _ProtocolError for any line that is not a header field.

    A web page can send an HTTP request to this port. A lenient parser would accept the request's body as messages."""
    _refuse_http(header)
    lines = header.split(b"\r\n")
    sizes = [int(found[1]) for found in map(LENGTH.fullmatch, lines) if found]
    if len(sizes) != 1 or not all(LENGTH.fullmatch(line) or OTHER_FIELD.fullmatch(line) for line in lines):
        raise _ProtocolError(f"expected `Content-Length: N` before a message, not {_excerpt(header)}")
    if not 0 < sizes[0] <= MAX_MESSAGE_BYTES:
        raise _ProtocolError(f"a message of {sizes[0]} bytes; expected 1 to {MAX_MESSAGE_BYTES}")
    return sizes[0]


def _excerpt(data: bytes | bytearray) -> str:
    """Return the first bytes of an invalid message as text."""
    return repr(bytes(data[:EXCERPT_BYTES]))[1:] + ("..." if len(data) > EXCERPT_BYTES else "")


@contextmanager
def wire_over(connection: socket.socket) -> Iterator[Wire]:
    """Context manager for a wire over `connection`. On exit it closes both, even if output is lost."""
    writer = connection.makefile("wb")
    wire = Wire(connection.fileno(), writer)
    try:
        yield wire
    finally:
        wire.close()
        with suppress(OSError):
            writer.close()
        connection.close()
