"""Host ends of the UARTs: standard streams, files, pseudo terminals, TCP."""

from __future__ import annotations

import os
import socket
import threading

import pytest

from emu.run.input_log import HEADER, TimestampedInput, read_input_log
from emu.run.uart_backends import open_port, wait_for_input
from tests.watchdog import HANG


def test_a_file_gets_every_byte_and_gives_none(tmp_path):
    path = tmp_path / "uart.log"
    port = open_port(str(path), 1)
    port.write(b"\x00hello\xff")
    assert port.read() == b""
    assert port.in_fd is None
    port.close()
    assert path.read_bytes() == b"\x00hello\xff"


def test_no_port_at_all_loses_nothing():
    port = open_port("none", 2)
    port.write(b"into the void")
    assert port.lost == 0
    assert port.read() == b""


def test_a_pseudo_terminal_carries_raw_bytes_both_ways(capsys):
    port = open_port("pty", 2)
    name = capsys.readouterr().err.split()[-1]
    terminal = os.open(name, os.O_RDWR | os.O_NOCTTY)
    port.write(b"a\r\n\x03")
    assert os.read(terminal, 10) == b"a\r\n\x03"
    os.write(terminal, b"\x04\n")
    assert wait_for_input([port], 5)
    assert port.read() == b"\x04\n"
    assert port.read() == b""
    assert port.in_fd is not None
    os.close(terminal)
    port.close()


def test_a_terminal_nobody_reads_loses_bytes_and_counts_them():
    port = open_port("pty", 1)
    port.write(bytes(1 << 20))
    assert port.lost > 0
    port.close()


def test_a_tcp_port_waits_for_one_connection_and_ends_with_it(capsys):
    with socket.create_server(("127.0.0.1", 0)) as probe:
        number = probe.getsockname()[1]
    peer: list[socket.socket] = []

    def connect() -> None:
        while not peer:
            try:
                peer.append(socket.create_connection(("127.0.0.1", number), timeout=HANG))
            except ConnectionRefusedError:
                continue

    thread = threading.Thread(target=connect)
    thread.start()
    port = open_port(f"tcp:{number}", 1)
    thread.join()
    assert f"127.0.0.1:{number}" in capsys.readouterr().err
    peer[0].sendall(b"ping")
    assert wait_for_input([port], 5)
    assert port.read() == b"ping"
    port.write(b"pong")
    assert peer[0].recv(10) == b"pong"
    peer[0].close()
    assert wait_for_input([port], 5)
    assert port.read() == b""
    assert port.in_fd is None
    port.write(b"x" * 10)
    port.write(b"x" * 10)
    port.close()


@pytest.mark.parametrize("text", ["tcp:", "tcp:x", "tcp:65536", "tcp:-1"])
def test_a_bad_tcp_port_is_refused(text):
    with pytest.raises(ValueError, match="expected tcp:PORT"):
        open_port(text, 1)


def test_stamps_come_back_as_they_were_written(tmp_path):
    path = tmp_path / "stamps"
    entries = (0, 1, b"\x00\xff"), (147456, 2, b"go\n"), (147456, 1, b"!")
    stamps = [TimestampedInput(*entry) for entry in entries]
    with path.open("w") as stream:
        stream.write(HEADER + "\n\n")
        for stamp in stamps:
            stamp.write(stream)
    assert read_input_log(str(path), (1, 2)) == stamps


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 1\n", "line 1: expected `CYCLE UART HEX`"), ("\n1 1 4\n", "line 2: expected `CYCLE UART HEX`"),
        ("x 1 41\n", "line 1: expected"), ("1 3 41\n", "line 1: there is no UART3"),
        ("5 1 41\n4 1 41\n", "line 2: cycle 4 is lower"), ("-5 1 41\n", "line 1: cycle -5 is lower"),
    ],
)  # fmt: skip
def test_a_damaged_record_is_refused_with_its_line(tmp_path, text, expected):
    path = tmp_path / "stamps"
    path.write_text(text)
    with pytest.raises(ValueError) as caught:
        read_input_log(str(path), (1, 2))
    assert expected in str(caught.value)
