"""Servers on local ports with two clients, half a request, another address, a clock that jumps, and SIGTERM."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

import emu
from arena.campaign.campaign import Plan
from arena.replay.live_feed import LiveFile, live_path
from arena.scene.loader import load_scene, scripted
from tests.watchdog import HANG

pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")]
JUMPING_CLOCK = """
import itertools, sys, time
from importlib import import_module
real, calls = time.time, itertools.count()
time.time = lambda: real() + (-1) ** next(calls) * 1e8
sys.exit(import_module(sys.argv[1] + ".cli").main(sys.argv[2:]))
"""
"""Program that runs a command while the time of day jumps by three years at each reading."""
ADDRESS = re.compile(r"127\.0\.0\.1:(\d+)(/\S*)?")
FEW = ("--robots", "1", "--objects", "1")
SOCKET = "listening on /"
ECHO = """#include <xc.h>
int main(void)
{
    U1MODEbits.UARTEN = 1;
    U1STAbits.UTXEN = 1;
    for (;;) {
        if (U1STAbits.URXDA) {
            U1TXREG = U1RXREG + 1;
        }
    }
}
"""


@contextmanager
def served(*words: str) -> Iterator[tuple[int, str]]:
    """Start a server; yield its port and path. Then end it by SIGTERM, which causes no traceback.

    The server is bound to 127.0.0.1 alone.
    """
    process = subprocess.Popen([sys.executable, "-u", "-c", JUMPING_CLOCK, *words], text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT)  # fmt: skip
    assert process.stdout is not None
    lines = []
    try:
        for line in process.stdout:
            lines.append(line)
            if found := ADDRESS.search(line):
                if sys.platform == "linux":  # where all of 127/8 is local
                    with pytest.raises(ConnectionRefusedError):
                        socket.create_connection(("127.0.0.2", int(found[1])), HANG)
                yield int(found[1]), found[2] or "/"
                break
        process.terminate()
        lines.append(process.communicate(timeout=HANG)[0])
        assert found, lines
        assert process.returncode in (0, -signal.SIGTERM), lines
        assert "Traceback" not in "".join(lines)
    finally:
        process.kill()
        process.wait()


@contextmanager
def on_socket(path: Path, *words: str) -> Iterator[None]:
    """Start a debugger on a Unix socket meanwhile. Then end it by SIGTERM, which causes no traceback."""
    process = subprocess.Popen([sys.executable, "-u", "-c", JUMPING_CLOCK, *words, "--socket", str(path)], text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT)  # fmt: skip
    assert process.stdout is not None
    try:
        lines: list[str] = []
        for line in process.stdout:
            lines.append(line)
            if SOCKET in line:
                break
        yield
        process.terminate()
        lines.append(process.communicate(timeout=HANG)[0])
        assert process.returncode in (0, -signal.SIGTERM), lines
        assert "Traceback" not in "".join(lines)
    finally:
        process.kill()
        process.wait()


def connected(port: int) -> closing[socket.socket]:
    return closing(socket.create_connection(("127.0.0.1", port), HANG))


def answer(client: socket.socket, said: bytes) -> bytes:
    """Return the first bytes of the answer to a message."""
    client.sendall(said)
    return client.recv(4096)


def request(number: int, command: str) -> bytes:
    body = json.dumps({"seq": number, "type": "request", "command": command, "arguments": {"adapterID": "x"}})
    return f"Content-Length: {len(body)}\r\n\r\n{body}".encode()


def test_the_uart_serves_its_first_client(tmp_path: Path) -> None:
    (tmp_path / "echo.c").write_text(ECHO)
    image = emu.build(tmp_path / "echo.c", output=tmp_path / "echo.elf")
    with served("emu", "run", str(image), "--uart1", "tcp:0") as (port, _), connected(port) as first:
        assert answer(first, b"A") == b"B"
        with suppress(OSError), connected(port) as second:
            second.sendall(b"Q")
        assert answer(first, b"K") == b"L"


def test_the_debugger_serves_its_first_client_before_the_second() -> None:
    with served("emu", "debug", "--port", "0") as (port, _), connected(port) as first, connected(port) as second:
        assert b"initialize" in answer(first, request(1, "initialize"))
        second.sendall(request(1, "initialize"))
        assert b"threads" in answer(first, request(2, "threads"))
        first.close()
        assert b"initialize" in second.recv(4096)


def test_the_debugger_of_a_trial_serves_its_first_client_alone() -> None:
    words = ("arena", "debug", "clustering", *FEW, "--robot", "0", "--port", "0")
    with served(*words) as (port, _), connected(port) as first:
        assert b"initialize" in answer(first, request(1, "initialize"))
        with suppress(OSError), connected(port) as second:
            second.sendall(request(1, "initialize"))
        assert b"threads" in answer(first, request(2, "threads"))


@pytest.mark.parametrize("words", [("emu", "debug"), ("arena", "debug", "clustering", *FEW, "--robot", "0")])
def test_a_debugger_on_a_unix_socket_serves_its_first_client(tmp_path: Path, words: tuple[str, ...]) -> None:
    path = tmp_path / "debug"
    with on_socket(path, *words), socket.socket(socket.AF_UNIX) as first:
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        first.settimeout(HANG)
        first.connect(str(path))
        assert b"initialize" in answer(first, request(1, "initialize"))
        with suppress(OSError), socket.socket(socket.AF_UNIX) as second:
            second.connect(str(path))
            second.sendall(request(1, "initialize"))
        assert b"threads" in answer(first, request(2, "threads"))


def test_the_debugger_of_a_studio_serves_its_first_client_alone() -> None:
    """The studio opens a port when the page asks for a debugger; it refuses connections after the first client."""
    with served("arena", "studio", "clustering", *FEW, "--port", "0") as (port, path):

        token = path.partition("=")[2]

        def ask(method: str, place: str, body: bytes = b"") -> Any:
            head = f"{method} {place} HTTP/1.0\r\nHost: 127.0.0.1:{port}\r\nX-Studio-Token: {token}\r\n"
            with connected(port) as client:
                client.sendall(head.encode() + b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
                said = b"".join(iter(lambda: client.recv(1 << 16), b"")).partition(b"\r\n\r\n")
            return json.loads(said[2]) if b" 200 " in said[0] else None

        while ask("POST", "/do", b'{"do": "debug", "robot": 0}') is None:
            time.sleep(0.05)  # the trial is not ready
        while (debugger := ask("GET", "/more?from=0&epoch=0")["now"]["debugger"]) is None:
            time.sleep(0.05)
        with connected(debugger["port"]) as first:
            assert b"initialize" in answer(first, request(1, "initialize"))
            with pytest.raises(ConnectionRefusedError), connected(debugger["port"]):
                pass
            assert b"threads" in answer(first, request(2, "threads"))
            assert ask("GET", "/more?from=0&epoch=0")["now"]["debugger"]["is_connected"]


def live(folder: Path) -> list[str]:
    return ["arena", "replay", str(folder), "--live", "--port", "0"]


def studio(_: Path) -> list[str]:
    return ["arena", "studio", "clustering", "--brain", "scripted", *FEW, "--port", "0"]


@pytest.mark.parametrize(("words", "status"), [(live, 503), (studio, 200)])
def test_pages_are_served_beside_half_a_request(
    tmp_path: Path, words: Callable[[Path], list[str]], status: int
) -> None:
    """A client that sends half a request does not block others. The live page has no data yet, so it answers 503."""
    plan = Plan(scripted(load_scene("clustering")), "scripted", "A", None, 1, 6.0, 1)
    file = LiveFile(live_path(tmp_path, 1), plan.key() | {"seed": 1, "faults": []})
    try:
        with served(*words(tmp_path)) as (port, path), connected(port) as half:
            half.sendall(b"GET / HT")
            for _ in range(2):
                with connected(port) as client:
                    said = answer(client, f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
                    assert said.split()[1] == str(status).encode()
    finally:
        file.close()
