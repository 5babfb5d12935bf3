"""The portable kernel on the POSIX port with address and undefined-behaviour sanitizers: every TEST of host/*.c."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from tests.watchdog import HANG

HOST = Path(__file__).parents[1] / "host"
TESTS = [name for file in sorted(HOST.glob("*.c")) for name in re.findall(r"^TEST\((\w+),", file.read_text(), re.M)]


@pytest.mark.slow
def test_the_kernel_on_posix(host_program: Path) -> None:
    """Each TEST of host/*.c passes in its own process. Its second argument names the requirement and its source."""
    done = subprocess.run([host_program, "all"], capture_output=True, text=True, timeout=HANG, check=False)
    results = dict(line.split() for line in done.stdout.splitlines())
    assert sorted(results) == sorted(TESTS)
    assert [name for name, status in results.items() if status != "0"] == [], done.stderr
