"""Serial port: sends and receives raw bytes with a time limit.

Python's `termios` suffices. A package such as pyserial would add Windows, which the rest of this project does not
support.
"""

from __future__ import annotations

import contextlib
import os
import select
import termios
import time
import tty
from collections.abc import Iterator
from types import TracebackType
from typing import Final, Protocol

_STUCK_SECONDS: Final = 10.0
"""Seconds after which a port that accepts no byte is reported as failed; a block takes 9 ms on the wire."""


class Line(Protocol):
    """Byte stream in both directions, with a clock."""

    def write(self, data: bytes) -> None:
        """Send all bytes."""

    def read(self, seconds: float) -> bytes:
        """Return the next byte, or nothing after `seconds`."""

    def discard_received(self) -> None:
        """Discard received bytes."""

    def now(self) -> float:
        """Return the time in seconds since an arbitrary origin."""


class SerialPort:
    """The device of a serial port, 8N1 without flow control; use it in `with`."""

    def __init__(self, device: str, baud: int) -> None:
        """Open the port. Raises OSError, or ValueError for no serial port or the terminal of this process."""
        self.device: Final = device
        self._file: Final = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            if not os.isatty(self._file):
                raise ValueError(f"{device} is no serial port")
            with contextlib.suppress(OSError):  # only a terminal of this session has a process group to read
                os.tcgetpgrp(self._file)
                raise ValueError(f"{device} is the terminal in which this runs, no serial port")
            self._set(baud)
        except BaseException:
            os.close(self._file)
            raise

    def _set(self, baud: int) -> None:
        speed = getattr(termios, f"B{baud}")
        try:
            tty.setraw(self._file)
            attributes = termios.tcgetattr(self._file)
            attributes[2] |= termios.CLOCAL | termios.CREAD
            attributes[2] &= ~(termios.CSTOPB | getattr(termios, "CRTSCTS", 0))
            attributes[4] = attributes[5] = speed
            termios.tcsetattr(self._file, termios.TCSANOW, attributes)
        except termios.error as error:
            raise ValueError(f"{self.device}: cannot be set to {baud} baud: {error.args[-1]}") from None

    def __enter__(self) -> SerialPort:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._file)

    @contextlib.contextmanager
    def _naming_the_port(self) -> Iterator[None]:
        """Return an error of the operating system with the port's name added."""
        try:
            yield
        except BlockingIOError:
            raise
        except OSError as error:
            raise OSError(f"{self.device} is gone: {error.strerror}") from None

    def write(self, data: bytes) -> None:
        """Send all bytes. Raises OSError if the port is closed or accepts no bytes."""
        while data:
            if not select.select([], [self._file], [], _STUCK_SECONDS)[1]:
                raise OSError(f"{self.device} takes no bytes: its other end does not read, or the radio is gone")
            with contextlib.suppress(BlockingIOError), self._naming_the_port():
                data = data[os.write(self._file, data) :]

    def read(self, seconds: float) -> bytes:
        """Return the next byte, or nothing after `seconds`. Raises OSError if the port is closed."""
        if not select.select([self._file], [], [], max(seconds, 0.0))[0]:
            return b""
        try:
            with self._naming_the_port():
                byte = os.read(self._file, 1)
        except BlockingIOError:
            return b""
        if not byte:
            raise OSError(f"{self.device} was closed at its other end")
        return byte

    def discard_received(self) -> None:
        """Discard received bytes. The next write reports a closed port."""
        with contextlib.suppress(termios.error):
            termios.tcflush(self._file, termios.TCIFLUSH)

    def now(self) -> float:
        """Return the monotonic clock in seconds."""
        return time.monotonic()
