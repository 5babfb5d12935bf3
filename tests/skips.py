"""pytest plugin: after a run, list the skipped tests with the package that would enable them.

With `--allowed-skips FILE` (`.ci/allowed-skips`) any other skip is a failure.
"""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

REMEDY = re.compile(r"(Debian packages?:? [\w ,.+-]+|extra: \w+)")
"""Part of a skip reason that names the package to install."""


class Skips:
    """Collector of skipped tests in the main process; the workers of xdist report to it."""

    def __init__(self, allowed: Path | None) -> None:
        self.allowed = patterns(allowed) if allowed is not None else None
        self.found: list[tuple[str, str]] = []
        """Pairs of test and reason."""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.skipped and not hasattr(report, "wasxfail"):
            self.found.append((report.nodeid, reason_of(report.longrepr)))

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.skipped:
            self.found.append((report.nodeid, reason_of(report.longrepr)))

    def forbidden(self) -> list[tuple[str, str]]:
        """Return the skipped tests that the file of allowed skips does not name."""
        if self.allowed is None:
            return []
        return sorted({one for one in self.found if not any(pattern.search(one[0]) for pattern in self.allowed)})

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self.forbidden() and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        if not self.found:
            return
        terminalreporter.section("skipped tests and what enables them")
        for line in lines_of(self.found):
            terminalreporter.write_line(line)
        for test, reason in self.forbidden():
            terminalreporter.write_line(f"NOT ALLOWED: {test}: {reason}", red=True)


def reason_of(longrepr: Any) -> str:
    """Return the reason of a skipped test."""
    return str(longrepr[2] if isinstance(longrepr, tuple) else longrepr).removeprefix("Skipped: ")


def lines_of(found: list[tuple[str, str]]) -> list[str]:
    """Return one line per package to install, with the number of tests that it enables and their files."""
    by_remedy: dict[str, set[str]] = defaultdict(set)
    for test, reason in found:
        named = REMEDY.search(reason)
        by_remedy[named[1] if named else f"nothing to install: {reason}"].add(test)
    lines = []
    for remedy, tests in sorted(by_remedy.items()):
        files = sorted({test.partition("::")[0] for test in tests})
        lines.append(f"{len(tests):4}  {remedy}: {', '.join(files)}")
    return lines


def patterns(path: Path) -> list[re.Pattern[str]]:
    """Return the regular expressions of a file, one per line, each followed by ` # ` and a reason. Raises ValueError
    if a reason is missing."""
    made = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        text, _, reason = (part.strip() for part in line.partition(" # "))
        if not line.strip() or line.startswith("#"):
            continue
        if not reason:
            raise ValueError(f"{path}:{number}: expected PATTERN # REASON")
        made.append(re.compile(text))
    return made
