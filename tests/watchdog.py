"""pytest plugin: end a hanging test, and name tests that have been silent for long. No test asserts host time.

A test hangs if its process tree has used more than `CPU_LIMIT` seconds of CPU in this test (an endless loop), or if it
has used none for `IDLE_LIMIT` seconds (a deadlock). Other programs do not increase a test's CPU time, so a loaded
machine cannot make a test fail. On a hang the watchdog prints the stacks of all threads and ends the process with its
children; xdist then reports the worker's test as crashed.
"""

from __future__ import annotations

import faulthandler
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Final

import pytest

CPU_LIMIT: Final = 1800.0
"""Maximum CPU time of one test in seconds; the slowest test takes about 100."""
IDLE_LIMIT: Final = 600.0
"""Maximum duration in seconds without any CPU use."""
IDLE_SHARE: Final = 0.002
"""Share of a core below which a process tree counts as idle; a process that only polls uses less."""
SILENCE: Final = 30.0
"""Seconds without a result after which the names of running tests are printed."""
HANG: Final = 3600.0
"""Value in seconds for `timeout=` arguments in tests. It exceeds the watchdog's limits, so that no test has a
deadline of its own."""
TICK: Final = 5.0
PROC: Final = Path("/proc")


def tree_of(root: int) -> list[int]:
    """Return the process ids of `root` and all its descendants; only `root` on systems without /proc."""
    children: dict[int, list[int]] = {}
    for entry in PROC.glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        children.setdefault(int(fields[1]), []).append(int(entry.parent.name))
    found = [root]
    for process in found:
        found += children.get(process, [])
    return found


def cpu_of(processes: list[int]) -> float:
    """Return the CPU seconds of the processes and of their children that have ended."""
    ticks = 0
    for process in processes:
        try:
            fields = (PROC / str(process) / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        ticks += sum(map(int, fields[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK") if processes and PROC.is_dir() else time.process_time()


class Watchdog:
    """Monitor of the tests in one process. Limits are in seconds, as the constants above."""

    def __init__(self, cpu_limit: float = CPU_LIMIT, idle_limit: float = IDLE_LIMIT, tick: float = TICK) -> None:
        self.cpu_limit, self.idle_limit, self.tick = cpu_limit, idle_limit, tick
        self.test = ""
        """Node id of the running test; "" between tests."""
        self._active_at = 0.0
        self._cpu_at_start: float | None = None
        self._cpu_seen = 0.0
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)

    def start(self) -> None:
        """Start the monitoring thread."""
        self._thread.start()

    def begin(self, test: str) -> None:
        """Begin to monitor a test, with limits that count from the next tick. Cheap, because it is called for every
        test."""
        with self._lock:
            self.test = test
            self._cpu_at_start = None

    def end(self) -> None:
        """Record that the running test has ended."""
        with self._lock:
            self.test = ""

    def stop(self) -> None:
        """Stop the monitoring thread."""
        self._stop.set()

    def verdict(self, cpu: float, now: float) -> str:
        """Return why the running test hangs, or "" if it does not. Input: CPU seconds of the process tree and the
        clock."""
        if not self.test:
            return ""
        if self._cpu_at_start is None:
            self._cpu_at_start = self._cpu_seen = cpu
            self._active_at = now
        if cpu - self._cpu_seen > IDLE_SHARE * (now - self._active_at):
            self._cpu_seen, self._active_at = cpu, now
        if cpu - self._cpu_at_start > self.cpu_limit:
            return f"has used {cpu - self._cpu_at_start:.0f} s of CPU"
        if now - self._active_at > self.idle_limit:
            return f"has used no CPU for {now - self._active_at:.0f} s"
        return ""

    def _watch(self) -> None:
        while not self._stop.wait(self.tick):
            processes = tree_of(os.getpid())
            with self._lock:
                own = time.thread_time()  # CPU time of this thread, which does not belong to the test: it reads /proc
                why = self.verdict(cpu_of(processes) - own, time.monotonic())
                test = self.test
            if why:
                self._kill(test, why, processes)

    @staticmethod
    def _kill(test: str, why: str, processes: list[int]) -> None:
        print(f"\nwatchdog: {test} hangs: it {why}; stacks of all threads follow", file=sys.__stderr__, flush=True)
        faulthandler.dump_traceback(file=sys.__stderr__ or 2)
        for process in reversed(processes[1:]):
            os.kill(process, signal.SIGKILL)
        os._exit(1)


class WatchdogPlugin:
    """Plugin that runs a watchdog in every process with tests."""

    def __init__(self) -> None:
        self.watchdog = Watchdog()

    def pytest_sessionstart(self) -> None:
        self.watchdog.start()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> object:
        self.watchdog.begin(item.nodeid)
        try:
            return (yield)
        finally:
            self.watchdog.end()

    def pytest_sessionfinish(self) -> None:
        self.watchdog.stop()


class Silence:
    """Plugin of the main process that prints the names of running tests after `SILENCE` seconds without a result."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._running: dict[str, float] = {}
        self._last = time.monotonic()
        self._lock = threading.Lock()
        self._stop = threading.Event()

    def pytest_sessionstart(self) -> None:
        threading.Thread(target=self._watch, name="silence", daemon=True).start()

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        with self._lock:
            self._running[nodeid] = time.monotonic()

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        with self._lock:
            self._running.pop(nodeid, None)
            self._last = time.monotonic()

    def pytest_sessionfinish(self) -> None:
        self._stop.set()

    def lines(self, now: float) -> list[str]:
        """Return the lines to print at `now` (monotonic clock, seconds): one per running test, or none."""
        with self._lock:
            if now - self._last < SILENCE:
                return []
            self._last = now
            return [f"running for {now - since:.0f} s: {test}" for test, since in self._running.items()]

    def _watch(self) -> None:
        reporter = self._config.pluginmanager.get_plugin("terminalreporter")
        while reporter is not None and not self._stop.wait(1.0):
            for line in self.lines(time.monotonic()):
                reporter.ensure_newline()
                reporter.write_line(line)
