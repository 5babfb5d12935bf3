"""Host ports of the emulated UARTs: standard streams, files, pseudo terminals, TCP connections.

Input: a specification from the command line (`-`, FILE, `pty`, `tcp:PORT`, `none`). Output: bidirectional
`ConsolePort`s. Files and standard output receive every byte. A terminal or peer that does not read loses bytes, which
`ConsolePort.lost` counts.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import socket
import sys
from collections.abc import Callable
from typing import Final

from emu.host.local_server import accept, address_of, listener

READ_SIZE: Final = 4096

NO_ROOM: Final = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)
"""Error numbers of a full disk, an exceeded file size limit and an exceeded quota."""
SPECIFICATIONS: Final = "-, FILE, pty, tcp:PORT or none"


class ConsolePort:
    """Host port of one UART. `out_fd` or `in_fd` is None if that direction does not exist or has ended."""

    def __init__(
        self, out_fd: int | None, in_fd: int | None, close: Callable[[], None] | None = None, blocking: bool = True
    ) -> None:
        self.out_fd = out_fd
        self.in_fd = in_fd
        self.blocking: Final = blocking
        self.capture: bytearray | None = None
        """Collects the firmware's output instead of sending it, unless None."""
        self.lost = 0
        """Number of bytes sent by the firmware that the host side did not accept."""
        self._discards: Final = out_fd is None
        self._close: Final = close

    def write(self, data: bytes) -> None:
        """Write the firmware's output.

        Raises BrokenPipeError if the reader of standard output has closed it, OSError if there is no room for it.
        """
        if self.capture is not None:
            self.capture += data
            return
        while data and self.out_fd is not None:
            try:
                data = data[os.write(self.out_fd, data) :]
            except BlockingIOError:
                if not self.blocking:
                    break
                select.select([], [self.out_fd], [])
            except BrokenPipeError:
                if self._close is None:
                    raise
                self.out_fd = None
            except OSError as error:
                if error.errno in NO_ROOM:
                    raise
                self.out_fd = None
        if not self._discards:
            self.lost += len(data)

    def read(self) -> bytes:
        """Return the input that is available now, without waiting. At the end of input, set `in_fd` to None."""
        if self.in_fd is None or not select.select([self.in_fd], [], [], 0)[0]:
            return b""
        try:
            data = os.read(self.in_fd, READ_SIZE)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self.in_fd = None
        return data

    def close(self) -> None:
        """Close the resources opened for the port."""
        if self._close is not None:
            self._close()


def open_port(specification: str, uart: int, with_input: bool = True) -> ConsolePort:
    """Open the port for UART number `uart`.

    Raises ValueError for an invalid specification, OSError if the port cannot be opened.
    """
    if specification == "none":
        return ConsolePort(None, None)
    if specification == "-":
        return ConsolePort(1, 0 if with_input and _is_open(0) else None)
    if specification == "pty":
        return _open_pty(uart, with_input)
    if specification.startswith("tcp:"):
        return _open_tcp(specification, uart, with_input)
    file = os.open(specification, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
    return ConsolePort(file, None, lambda: os.close(file))


def _is_open(fd: int) -> bool:
    try:
        os.fstat(fd)
    except OSError:
        return False
    return True


def _open_pty(uart: int, with_input: bool) -> ConsolePort:
    """Open a pseudo terminal in raw mode, so that it does not echo the firmware's output back."""
    import pty
    import tty

    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    print(f"UART{uart} is {os.ttyname(slave)}", file=sys.stderr, flush=True)

    def close() -> None:
        os.close(master)
        os.close(slave)  # open until now, because the terminal would report end of file without a reader

    return ConsolePort(master, master if with_input else None, close, blocking=False)


def _open_tcp(specification: str, uart: int, with_input: bool) -> ConsolePort:
    """Wait for one connection on the loopback interface. PORT 0 selects a free port, whose number is printed."""
    text = specification.removeprefix("tcp:")
    if not text.isdecimal() or int(text) > 0xFFFF:
        raise ValueError(f"{specification!r}: expected tcp:PORT with a number up to 65535")
    with listener(int(text)) as server:
        print(f"UART{uart} waits for a connection on {address_of(server)}", file=sys.stderr, flush=True)
        connection = accept(server, f"UART{uart}")
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setblocking(False)

    def close() -> None:
        with contextlib.suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)
        connection.close()

    return ConsolePort(connection.fileno(), connection.fileno() if with_input else None, close, blocking=False)


def wait_for_input(ports: list[ConsolePort], seconds: float) -> bool:
    """Wait at most `seconds` until a port has input or has ended. Return whether this happened."""
    sources = [port.in_fd for port in ports if port.in_fd is not None]
    return bool(select.select(sources, [], [], max(seconds, 0.0))[0])
