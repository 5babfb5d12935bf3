"""Closed or full standard streams: with a closed pipe as output (`emu --help | head -0`), exit status 0 without a
message."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.cases import check_all
from tests.full_device import needs_full_device
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[1]
WORDS = [
    "emu --help", "emu --version", "emu run --help", "emu completion bash",
    "toolchain --help", "toolchain --version", "toolchain cc --help", "toolchain size --help",
    "arena --help", "arena --version", "arena run --help", "arena scenes",
    "openswarm --help", "openswarm --version", "openswarm new --help", "openswarm doctor",
]  # fmt: skip


def run(line: str, **options: Any) -> subprocess.CompletedProcess[Any]:
    """Run a command line of the project in its own process and return its status and standard error."""
    options = {"stderr": subprocess.PIPE, "cwd": ROOT, "timeout": HANG, "check": False} | options
    return subprocess.run([sys.executable, "-m", *line.split()], **options)


@pytest.mark.slow
def test_a_reader_that_has_gone_is_no_failure() -> None:
    """If standard output is a pipe whose reader has closed it, a command ends with status 0 and no message.
    PYTHONUNBUFFERED is removed, because without buffering the flush after `main` would have nothing to write."""
    surroundings = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}

    def check(line: str) -> None:
        reader, writer = os.pipe()
        os.close(reader)
        done = run(line, stdout=writer, env=surroundings)
        os.close(writer)
        assert (done.returncode, done.stderr) == (0, b"")

    check_all(check, WORDS)


@needs_full_device
def test_a_full_disk_under_the_output_is_one_line() -> None:
    """If standard output is on a full disk, a command ends with status 2 and one line."""

    def check(line: str) -> None:
        with Path("/dev/full").open("wb") as full:
            done = run(line, stdout=full, text=True)
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert "No space left on device" in done.stderr

    check_all(check, ["emu --help", "emu --version", "toolchain --version", "arena scenes", "openswarm --version"])


@pytest.mark.parametrize(
    ("line", "closed", "status", "said"),
    [
        ("emu --version", 1, 0, b""),
        ("toolchain --version", 1, 0, b""),
        ("arena scenes", 1, 0, b""),
        ("openswarm --version", 1, 0, b""),
        ("emu nothing", 2, 2, b""),
        ("emu info -", 0, 2, b"emu info: -: is empty; expected an ELF executable for dsPIC30F or an Intel HEX file\n"),
    ],
)
def test_a_stream_that_is_closed_is_empty_or_wants_nothing(line: str, closed: int, status: int, said: bytes) -> None:
    """A standard stream that the shell closed (`<&-`, `>&-`, `2>&-`) is empty as input and ignored as output, without
    a traceback."""
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL}
    done = run(line, **streams, preexec_fn=lambda: os.close(closed))
    assert (done.returncode, done.stderr) == (status, said)
