"""The host end of the emulated UARTs: standard streams, files, pseudo terminals, TCP connections.

What enters: a specification from the command line (`-`, FILE, `pty`, `tcp:PORT`, `none`). What leaves: `Port`s with
bytes going both ways. Files and standard output get every byte; a terminal or peer that does not read loses bytes,
counted in `Port.lost`.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import sys
from collections.abc import Callable
from typing import Final

READ_SIZE: Final = 4096

SPECIFICATIONS: Final = "-, FILE, pty, tcp:PORT or none"


class Port:
    """One UART's connection. `out_fd` and `in_fd` are None when that direction does not exist or has ended."""

    def __init__(
        self, out_fd: int | None, in_fd: int | None, close: Callable[[], None] | None = None, patient: bool = True
    ) -> None:
        self.out_fd = out_fd
        self.in_fd = in_fd
        self.patient: Final = patient
        self.capture: bytearray | None = None
        """If set, what the firmware sends is collected here instead."""
        self.lost = 0
        """Bytes the firmware sent that nobody took."""
        self._discards: Final = out_fd is None
        self._close: Final = close

    def write(self, data: bytes) -> None:
        """Pass on what the firmware sent. Raises BrokenPipeError when standard output was closed by its reader."""
        if self.capture is not None:
            self.capture += data
            return
        while data and self.out_fd is not None:
            try:
                data = data[os.write(self.out_fd, data) :]
            except BlockingIOError:
                if not self.patient:
                    break
                select.select([], [self.out_fd], [])
            except BrokenPipeError:
                if self._close is None:
                    raise
                self.out_fd = None
            except OSError:
                self.out_fd = None
        if not self._discards:
            self.lost += len(data)

    def read(self) -> bytes:
        """What has arrived from outside, at once; an ended input sets `in_fd` to None."""
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
        """Give back what the port opened itself."""
        if self._close is not None:
            self._close()


def open_port(specification: str, uart: int, with_input: bool = True) -> Port:
    """The port for UART number `uart`. Raises ValueError for a bad specification, OSError if it cannot be opened."""
    if specification == "none":
        return Port(None, None)
    if specification == "-":
        return Port(1, 0 if with_input and _is_open(0) else None)
    if specification == "pty":
        return _open_pty(uart, with_input)
    if specification.startswith("tcp:"):
        return _open_tcp(specification, uart, with_input)
    file = os.open(specification, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
    return Port(file, None, lambda: os.close(file))


def _is_open(fd: int) -> bool:
    try:
        os.fstat(fd)
    except OSError:
        return False
    return True


def _open_pty(uart: int, with_input: bool) -> Port:
    """A pseudo terminal in raw mode, so that the firmware's own output is not echoed back to it."""
    import pty
    import tty

    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    print(f"UART{uart} is {os.ttyname(slave)}", file=sys.stderr, flush=True)

    def close() -> None:
        os.close(master)
        os.close(slave)  # kept open until now: without any reader the terminal would report its end

    return Port(master, master if with_input else None, close, patient=False)


def _open_tcp(specification: str, uart: int, with_input: bool) -> Port:
    """Wait for one connection on the loopback interface. PORT 0 takes any free one; it is printed."""
    text = specification.removeprefix("tcp:")
    if not text.isdecimal() or int(text) > 0xFFFF:
        raise ValueError(f"{specification!r}: expected tcp:PORT with a number up to 65535")
    with socket.create_server(("127.0.0.1", int(text))) as server:
        port = server.getsockname()[1]
        print(f"UART{uart} waits for a connection on 127.0.0.1:{port}", file=sys.stderr, flush=True)
        connection, _ = server.accept()
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setblocking(False)

    def close() -> None:
        with contextlib.suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)
        connection.close()

    return Port(connection.fileno(), connection.fileno() if with_input else None, close, patient=False)


def wait_for_input(ports: list[Port], seconds: float) -> bool:
    """Wait at most `seconds` until one of the ports has input or has ended; whether it happened."""
    sources = [port.in_fd for port in ports if port.in_fd is not None]
    return bool(select.select(sources, [], [], max(seconds, 0.0))[0])
