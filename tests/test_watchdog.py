"""The watchdog distinguishes a hang from a busy machine, ends a hanging test, and names silent tests."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.watchdog import SILENCE, Silence, Watchdog, cpu_of, tree_of

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = """
import subprocess, sys
from tests.watchdog import Watchdog
dog = Watchdog(cpu_limit=2.0, idle_limit=3.0, tick=0.5)
dog.start()
dog.begin("tests/test_it.py::test_hangs")
{hang}
"""


def end_of(hang: str) -> subprocess.CompletedProcess[str]:
    """Return the result of a process whose watched test executes the statement `hang`."""
    environment = os.environ | {"PYTHONPATH": str(ROOT / "tests")}
    return subprocess.run([sys.executable, "-c", PROGRAM.format(hang=hang)], env=environment, capture_output=True,
                          text=True, check=False)  # fmt: skip


@pytest.mark.slow
def test_an_endless_loop_is_ended_with_its_name_and_stacks() -> None:
    done = end_of("while True: pass")
    assert done.returncode == 1
    assert "tests/test_it.py::test_hangs hangs: it has used" in done.stderr
    assert "most recent call first" in done.stderr


def test_a_test_that_waits_for_ever_is_ended() -> None:
    done = end_of("import threading; threading.Event().wait()")
    assert done.returncode == 1
    assert "has used no CPU for" in done.stderr


@pytest.mark.slow
def test_work_of_a_child_process_counts() -> None:
    """A test that waits for a busy child process is not idle. The child's CPU time counts towards the limit, and the
    child is killed with the test."""
    done = end_of("subprocess.run([sys.executable, '-c', 'while True: pass'])")
    assert done.returncode == 1
    assert "s of CPU" in done.stderr


def test_a_busy_machine_is_no_hang() -> None:
    """A test that gets a hundredth of a core for an hour is neither idle nor over its limit."""
    dog = Watchdog()
    dog.begin("one")
    assert [dog.verdict(cpu=0.05 * second, now=5.0 * second) for second in range(720)] == [""] * 720
    assert "used no CPU" in dog.verdict(cpu=0.05 * 719, now=5.0 * 719 + 601)


def test_a_process_tree_has_its_descendants() -> None:
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    try:
        if Path("/proc").is_dir():
            assert child.pid in tree_of(os.getpid())
        assert cpu_of(tree_of(os.getpid())) > 0
    finally:
        child.kill()
        child.wait()


def test_silent_tests_are_named_once_per_period(pytestconfig: pytest.Config) -> None:
    silence = Silence(pytestconfig)
    silence.pytest_runtest_logstart("tests/a.py::test_long")
    now = time.monotonic()
    assert silence.lines(now + SILENCE - 1) == []
    (line,) = silence.lines(now + SILENCE + 1)
    assert line.endswith("s: tests/a.py::test_long")
    assert silence.lines(now + SILENCE + 2) == []
    silence.pytest_runtest_logfinish("tests/a.py::test_long")
    assert silence.lines(now + 10 * SILENCE) == []
