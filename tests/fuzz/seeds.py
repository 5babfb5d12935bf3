"""Seeds of a campaign: new ones with every commit, as many as fit into the given time, and reproduction of a failure.

Every campaign takes `--seed N` (the first seed; default: from the hash of the current commit) and `--seconds S` (a
duration instead of the campaign's own number of tries). A try depends only on its seed, so an interrupted campaign
resumes with the `--seed` of its last output line.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SKIPPED = 77
"""Exit status of a campaign that cannot run because a program it needs is not installed."""
REPORT_EVERY = 30.0
"""Seconds between two progress lines on standard error."""
STATM = Path("/proc/self/statm")
WITHOUT_COMMIT = 1
"""First seed for a source tree without a git history."""


def resident_bytes() -> int:
    """Return the resident memory of this process in bytes; 0 on systems other than Linux."""
    if not STATM.exists():
        return 0
    return int(STATM.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@cache
def base_seed() -> int:
    """Return the first seed of this commit: the first 28 bits of its hash, so that seeds fit into 31 bits."""
    try:
        commit = subprocess.run(
            ["git", "-C", str(ROOT), "rev-parse", "HEAD"], capture_output=True, text=True, check=True)  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return WITHOUT_COMMIT
    return int(commit.stdout[:7], 16)


class Campaign:
    """Iterator over the seeds of one run of a campaign, as given on the command line.

    It ends after the number of tries or the time. With `--seconds` alone the number of tries is unlimited. At least
    one seed is always tried.
    """

    def __init__(self, parser: argparse.ArgumentParser, option: str, default: int, what: str) -> None:
        """Add `--seed`, `--seconds` and the number of tries `--option` (default `default`) to `parser`."""
        parser.add_argument(f"--{option}", type=int, help=f"{what} (default {default}; with --seconds no limit)")
        parser.add_argument("--seed", type=int, help="first seed (default: from the commit's hash)")
        parser.add_argument("--seconds", type=float, help="begin no new try after S seconds", metavar="S")
        self.parser = parser
        self.option = option
        self.default = default
        self.first = self.done = 0
        self.seed = 0
        """Seed of the current try."""
        self._count: int | None = None
        self._seconds: float | None = None
        self._start = time.monotonic()

    def parse(self, arguments: list[str] | None = None) -> argparse.Namespace:
        """Parse the options and start the campaign's clock."""
        options = self.parser.parse_args(arguments)
        self.first = self.seed = base_seed() if options.seed is None else options.seed
        self._seconds = options.seconds
        self._count = getattr(options, self.option)
        if self._count is None and options.seconds is None:
            self._count = self.default
        self._start = time.monotonic()
        return options

    @property
    def spent(self) -> float:
        """Return the seconds since the start of the campaign."""
        return time.monotonic() - self._start

    @property
    def over(self) -> bool:
        """Whether the time or the tries are used up."""
        late = self._seconds is not None and self.spent >= self._seconds
        return late or (self._count is not None and self.done >= self._count)

    def __iter__(self) -> Iterator[int]:
        reported = self.spent
        while not self.done or not self.over:
            self.seed = self.first + self.done
            if self.spent >= reported + REPORT_EVERY:
                reported = self.spent
                of = "" if self._count is None else f" of {self._count}"
                line = f"{self.done}{of} {self.option}, {reported:.0f} s, at seed {self.seed}"
                print(line, file=sys.stderr, flush=True)
            yield self.seed
            self.done += 1

    def ended(self, seen: str) -> int:
        """Print the summary and return exit status 0."""
        print(f"{self.done} {self.option} from seed {self.first}, {self.spent:.0f} s: {seen}", flush=True)
        return 0

    def failed(self, seen: object, seed: int | None = None) -> int:
        """Print the failed seed (default: the current one) and the command that repeats it; return exit status 1."""
        seed = self.seed if seed is None else seed
        print(f"FAILED at seed {seed}: {seen}", flush=True)
        script = Path(sys.argv[0]).resolve()
        place = script.relative_to(ROOT) if script.is_relative_to(ROOT) else script
        print(f"again: python {place} {' '.join(self._again(seed))}", flush=True)
        return 1

    def _again(self, seed: int) -> list[str]:
        """Return the options that repeat only the given seed, without a log of verdicts."""
        kept: list[str] = []
        words = iter(sys.argv[1:])
        for word in words:
            name, equals, _ = word.partition("=")
            if name in ("--seed", "--seconds", "--log", f"--{self.option}"):
                if not equals:
                    next(words, None)
            else:
                kept.append(word)
        return [*kept, "--seed", str(seed), f"--{self.option}", "1"]


def parser(text: str | None) -> argparse.ArgumentParser:
    """Return a parser whose help shows the docstring of a campaign's module unchanged."""
    return argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
