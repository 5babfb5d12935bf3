"""Closed or full standard streams: with a closed pipe as output (`emu --help | head -0`), exit status 0 without a
message."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[1]
WORDS = [
    "emu --help", "emu --version", "emu run --help", "emu completion bash",
    "toolchain --help", "toolchain --version", "toolchain cc --help", "toolchain size --help",
    "arena --help", "arena --version", "arena run --help", "arena scenes", "arena completion bash",
    "openswarm --help", "openswarm --version", "openswarm new --help", "openswarm doctor",
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("line", WORDS)
def test_a_reader_that_has_gone_is_no_failure(line: str) -> None:
    """If standard output is a pipe whose reader has closed it, a command ends with status 0 and no message.
    PYTHONUNBUFFERED is removed, because without buffering the flush after `main` would have nothing to write."""
    surroundings = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([sys.executable, "-m", *line.split()], stdout=writer, stderr=subprocess.PIPE, cwd=ROOT,
                          env=surroundings, timeout=HANG, check=False)  # fmt: skip
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has /dev/full")
@pytest.mark.parametrize(
    "line", ["emu --help", "emu --version", "toolchain --version", "arena scenes", "openswarm --version"]
)
def test_a_full_disk_under_the_output_is_one_line(line: str) -> None:
    """If standard output is on a full disk, a command ends with status 2 and one line."""
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run([sys.executable, "-m", *line.split()], stdout=full, stderr=subprocess.PIPE, cwd=ROOT,
                              text=True, timeout=HANG, check=False)  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "No space left on device" in done.stderr


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
    done = subprocess.run([sys.executable, "-m", *line.split()], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL,
                          stdin=subprocess.DEVNULL, preexec_fn=lambda: os.close(closed), cwd=ROOT, timeout=HANG,
                          check=False)  # fmt: skip
    assert (done.returncode, done.stderr) == (status, said)
