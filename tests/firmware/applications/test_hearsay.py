"""Forwarded neighbour information in apps/average: the application's own functions run on a host."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.watchdog import HANG

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[2] / "firmware"


def test_who_is_gone_is_forgotten_and_who_is_hidden_is_not(tmp_path):
    """A number reaches robots that never met its owner, up to six seconds later, and expires in time.

    A number that has expired does not return, however often it is forwarded and although messages wait for up to a
    second. The program runs under sanitizers.
    """
    if shutil.which("gcc") is None:
        pytest.skip("the host test is built with gcc, which is not installed (Debian package gcc)")
    folders = [FIRMWARE, *(FIRMWARE / "openswarm" / one for one in ("include", "hal", "kernel", "io", "port/posix"))]
    folders += [FIRMWARE / "openswarm" / "board" / "host", FIRMWARE / "apps" / "clocks"]
    command = ["gcc", "-std=gnu99", "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined"]
    command += ["-fno-sanitize-recover=undefined", "-ffunction-sections", "-Wl,--gc-sections"]  # no kernel
    command += [f"-I{folder}" for folder in folders]
    subprocess.run([*command, HERE / "hearsay.c", "-o", tmp_path / "hearsay"], check=True)
    done = subprocess.run([tmp_path / "hearsay"], capture_output=True, text=True, check=False, timeout=HANG)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout == "it was known and forgotten\n"
