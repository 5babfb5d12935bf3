"""Servers on this machine serve programs of the same user only."""

from __future__ import annotations

import os
import socket
import stat
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from arena.replay.http import LOOPBACK, PageServer, RequestHandler
from emu.cli import main
from emu.host import local_server
from emu.host.local_server import REFUSED, accept, address_of, is_own_client, listener
from tests.watchdog import HANG

pytestmark = pytest.mark.skipif(os.name != "posix", reason="Unix sockets")
NOBODY = 65534
"""Number of the Unix user `nobody`."""
as_root = pytest.mark.skipif(
    sys.platform != "linux" or os.geteuid() != 0, reason="only root can start a process of another user"
)


@contextmanager
def child(user: int, work: Callable[[], object]) -> Iterator[None]:
    """Run `work` in a process of a user meanwhile."""
    process = os.fork()
    if process == 0:
        try:
            os.setuid(user)
            work()
            os._exit(0)
        except OSError:
            os._exit(1)
        finally:
            os._exit(2)
    try:
        yield
    finally:
        assert os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) == 0


def end_of(connection: socket.socket) -> bytes:
    """Return all that a server sends until it closes the connection; nothing if it resets the connection."""
    try:
        return b"".join(iter(lambda: connection.recv(4096), b""))
    except ConnectionResetError:
        return b""


@as_root
@pytest.mark.parametrize("is_mapped", [False, True])
def test_a_client_of_another_user_is_refused(is_mapped: bool, capsys: pytest.CaptureFixture[str]) -> None:
    """`accept` closes the connection of another user, also of an IPv6 socket, and returns the next own client."""
    with listener(0) as server:
        port = server.getsockname()[1]

        def foreign() -> None:
            family, address = (socket.AF_INET6, "::ffff:127.0.0.1") if is_mapped else (socket.AF_INET, LOOPBACK)
            with socket.socket(family) as client:
                client.settimeout(HANG)
                client.connect((address, port))
                if end_of(client):
                    raise OSError
                own_may_come.close()

        waiting, own_may_come = socket.socketpair()
        with child(NOBODY, foreign):
            own_may_come.close()
            with child(0, lambda: _own(waiting, port)), accept(server, "name") as own:
                assert own.recv(4) == b"mine"
    waiting.close()
    assert capsys.readouterr().err == f"name: {REFUSED}\n"


def _own(waiting: socket.socket, port: int) -> None:
    waiting.recv(1)  # ends when the other client has been refused
    with socket.create_connection((LOOPBACK, port), HANG) as client:
        client.sendall(b"mine")
        end_of(client)


@as_root
def test_pages_are_not_served_to_another_user() -> None:
    """The HTTP servers close the connection of another user without an answer."""

    class Handler(RequestHandler):
        def do_GET(self) -> None:
            self.send_page("secret")

    with PageServer((LOOPBACK, 0), Handler) as server:
        server.timeout = HANG

        def ask(expected: bytes) -> None:
            with socket.create_connection((LOOPBACK, server.server_port), HANG) as client:
                client.sendall(b"GET / HTTP/1.0\r\n\r\n")
                if expected != end_of(client)[-6:]:
                    raise OSError

        with child(NOBODY, lambda: ask(b"")):
            server.handle_request()
        with child(0, lambda: ask(b"secret")):
            server.handle_request()


def test_a_client_of_this_user_is_served() -> None:
    with listener(0) as server, socket.create_connection(server.getsockname(), HANG) as client:
        with accept(server, "name") as connection:
            assert is_own_client(connection)
        assert client.recv(1) == b""


@pytest.mark.skipif(sys.platform != "linux", reason="/proc/net/tcp")
def test_a_client_that_has_gone_has_no_owner() -> None:
    """An abandoned socket counts as user 0 in the kernel's list, and is refused although root may connect."""
    with listener(0) as server:
        client = socket.create_connection(server.getsockname(), HANG)
        client.sendall(b"data")
        client.close()
        with server.accept()[0] as connection:
            assert not is_own_client(connection)


def reset(address: tuple[str, int]) -> None:
    """Connect to a server, and reset the connection at once."""
    with socket.create_connection(address, HANG) as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


def test_a_client_that_resets_its_connection_ends_no_server() -> None:
    """Servers refuse a connection that the client has reset before they accept it, and serve the next one."""
    with listener(0) as server:
        reset(server.getsockname())
        with socket.create_connection(server.getsockname(), HANG) as client, accept(server, "name") as connection:
            assert connection.getpeername() == client.getsockname()
    with PageServer((LOOPBACK, 0), RequestHandler) as pages:
        pages.timeout = HANG
        reset((LOOPBACK, pages.server_port))
        pages.handle_request()


def test_without_a_list_of_sockets_local_clients_are_served(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(local_server, "TABLES", (tmp_path / "missing",))
    with listener(0) as server, socket.create_connection(server.getsockname(), HANG), server.accept()[0] as connection:
        assert is_own_client(connection)


def test_a_unix_socket_is_private_and_removed(tmp_path: Path) -> None:
    """The socket has mode 0600 and is removed at the end; one that a killed server has left is replaced."""
    path = tmp_path / "debug"
    before = os.umask(0)
    try:
        with socket.socket(socket.AF_UNIX) as killed:
            killed.bind(str(path))
        with listener(path) as server:
            assert stat.S_IMODE(path.stat().st_mode) == 0o600
            assert address_of(server) == str(path)
            with socket.socket(socket.AF_UNIX) as client:
                client.connect(str(path))
                with accept(server, "name") as connection:
                    client.sendall(b"x")
                    assert connection.recv(1) == b"x"
    finally:
        assert os.umask(before) == 0
    assert not path.exists()


@pytest.mark.parametrize(
    ("name", "words"),
    [("a" * 200, "too long"), ("missing/socket", "No such file or directory"), ("", "Address already in use")],
)
def test_an_unusable_path_is_one_line(
    name: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    assert main(["debug", "--socket", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"emu debug: {path}: ")
    assert words in said
    assert said.count("\n") == 1


def test_the_socket_of_a_running_server_and_other_files_are_kept(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("kept")
    with pytest.raises(OSError, match="in use"), listener(tmp_path / "file"):
        pass
    assert (tmp_path / "file").read_text() == "kept"
    with listener(tmp_path / "one") as server:
        with pytest.raises(OSError, match="in use"), listener(tmp_path / "one"):
            pass
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(tmp_path / "one"))
            server.accept()[0].close()  # the probe of the second server
            server.accept()[0].close()
