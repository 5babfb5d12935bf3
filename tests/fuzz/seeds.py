"""Which seeds a campaign tries: new ones with every commit, as many as fit into its time, and how to see one again.

Every campaign takes `--seed N` (the first seed; default: from the hash of the commit that is checked out) and
`--seconds S` (as long as that, instead of its own number of tries). What a seed does depends on nothing but the seed,
so an interrupted campaign resumes with the `--seed` of the last line it printed.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SKIPPED = 77
"""Exit status of a campaign that cannot run here, because a program it needs is not installed."""
REPORT_EVERY = 30.0
"""Seconds between two lines on standard error that say how far a campaign is."""
WITHOUT_COMMIT = 1
"""Where a source tree without its history begins."""


@cache
def base_seed() -> int:
    """First seed of this commit: the first 28 bits of its hash, so that seeds fit into 31 bits."""
    try:
        commit = subprocess.run(
            ["git", "-C", str(ROOT), "rev-parse", "HEAD"], capture_output=True, text=True, check=True)  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return WITHOUT_COMMIT
    return int(commit.stdout[:7], 16)


class Campaign:
    """The seeds of one run of a campaign, from the command line.

    Iterate over it; the loop ends when as many seeds are done as the campaign wants or its time is over. With
    `--seconds` alone there is no other limit; at least one seed is always tried.
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
        """The seed being tried."""
        self._count: int | None = None
        self._seconds: float | None = None
        self._start = time.monotonic()

    def parse(self, arguments: list[str] | None = None) -> argparse.Namespace:
        """The options; the campaign begins."""
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
        """Seconds since the campaign began."""
        return time.monotonic() - self._start

    @property
    def over(self) -> bool:
        """Whether time or tries are used up."""
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
        """Say what was seen; status 0."""
        print(f"{self.done} {self.option} from seed {self.first}, {self.spent:.0f} s: {seen}", flush=True)
        return 0

    def failed(self, seen: object, seed: int | None = None) -> int:
        """Name `seed` (default: the one that is being tried) and the command that tries it again; status 1."""
        seed = self.seed if seed is None else seed
        print(f"FAILED at seed {seed}: {seen}", flush=True)
        script = Path(sys.argv[0]).resolve()
        place = script.relative_to(ROOT) if script.is_relative_to(ROOT) else script
        print(f"again: python {place} {' '.join(self._again(seed))}", flush=True)
        return 1

    def _again(self, seed: int) -> list[str]:
        """The options of this run, for the seed that failed alone, whatever a file of verdicts says of it."""
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
    """A parser that shows the text of a campaign's module as it is written."""
    return argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
