"""Servers for programs of the same user: TCP on the loopback address, or a Unix socket with mode 0600.

Linux lists the owner of each socket of the machine in `/proc/net`, so a server on the loopback address refuses clients
of other users. Other systems do not tell the owner; there every local user reaches the port.
"""

from __future__ import annotations

import os
import socket
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import ENAMETOOLONG
from pathlib import Path
from typing import Final

LOOPBACK: Final = "127.0.0.1"
TABLES: Final = (Path("/proc/net/tcp"), Path("/proc/net/tcp6"))
"""The kernel's lists of TCP sockets: a client may connect to an IPv4 address by an IPv6 socket."""
MAPPED: Final = "0000000000000000FFFF0000"
"""Beginning of an IPv6 address that contains an IPv4 address, as the kernel writes it."""
PRIVATE: Final = 0o177
"""Mask for the mode of a Unix socket: only its owner may connect."""
ROOT_USER: Final = 0
REFUSED: Final = "a client of another user was refused; run client and server as one user"


def is_own_client(connection: socket.socket) -> bool:
    """Whether a client on the loopback address is a process of this user or of root, or its owner is unknown.

    A client that has closed its socket before the check has no owner and is refused.
    """
    if connection.family != socket.AF_INET:
        return True  # a Unix socket, to which only its owner can connect
    try:
        here, there = _endpoint(connection.getsockname()), _endpoint(connection.getpeername())
    except OSError:
        return False  # the client has reset the connection
    rows = _rows()
    if (here, there) not in rows:
        return True  # the list does not contain this process's sockets
    owner, is_open = rows.get((there, here), (ROOT_USER, False))
    return is_open and owner in (os.geteuid(), ROOT_USER)


def _rows() -> dict[tuple[str, str], tuple[int, bool]]:
    """Return user and state of each socket by its own end and the other end."""
    found = {}
    for path in TABLES:
        with suppress(OSError):
            for line in path.read_text().splitlines()[1:]:
                words = line.replace(MAPPED, "").split()
                found[words[1], words[2]] = int(words[7]), words[9] != "0"
    return found


def _endpoint(address: tuple[str, int]) -> str:
    """Return an address as the kernel writes it: 32 bits in the order of the machine, and the port."""
    number = int.from_bytes(socket.inet_aton(address[0]), sys.byteorder)
    return f"{number:08X}:{address[1]:04X}"


@contextmanager
def listener(place: int | Path) -> Iterator[socket.socket]:
    """Context manager for a listening socket on a port of the loopback address, or on a new Unix socket.

    A Unix socket that a killed server has left is replaced. Raises OSError with the path, for example if another file
    has the name.
    """
    if isinstance(place, int):
        with socket.create_server((LOOPBACK, place)) as server:
            yield server
        return
    if not hasattr(socket, "AF_UNIX"):
        raise OSError("this system has no Unix sockets; use a port")
    with socket.socket(socket.AF_UNIX) as server:
        before = os.umask(PRIVATE)
        try:
            _remove_stale(place)
            server.bind(str(place))
        except OSError as error:  # a path that is too long has no number
            raise OSError(error.errno or ENAMETOOLONG, error.strerror or str(error), str(place)) from None
        finally:
            os.umask(before)
        server.listen()
        try:
            yield server
        finally:
            place.unlink(missing_ok=True)


def _remove_stale(path: Path) -> None:
    """Remove a Unix socket on which no server listens."""
    with suppress(FileNotFoundError):
        if stat.S_ISSOCK(path.lstat().st_mode):
            with socket.socket(socket.AF_UNIX) as probe:
                try:
                    probe.connect(str(path))
                except ConnectionRefusedError:
                    path.unlink()


def accept(server: socket.socket, name: str) -> socket.socket:
    """Return the connection of the next client of this user; refuse others with a message of the command `name`."""
    while True:
        connection, _ = server.accept()
        if is_own_client(connection):
            return connection
        connection.close()
        print(f"{name}: {REFUSED}", file=sys.stderr, flush=True)


def address_of(server: socket.socket) -> str:
    """Return the address of a listening socket as messages show it."""
    name = server.getsockname()
    return name if isinstance(name, str) else f"{name[0]}:{name[1]}"
