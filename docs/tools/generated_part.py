"""The generated part of a page: a script of this folder checks it or, with --write, replaces it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class GeneratedPart:
    """The text between the marks `begin` and `end`, which stay on the page; without `end`, up to the page's end."""

    page: Path
    begin: str
    make: Callable[[], str]
    end: str = ""

    def current(self) -> str:
        """Return the page with this part as the script makes it now."""
        before, begin, rest = self.page.read_text("utf-8").partition(self.begin)
        if not begin:
            raise ValueError(f"{self.page}: has no {self.begin.strip()!r}")
        return before + begin + self.make() + (self.end + rest.partition(self.end)[2] if self.end else "")

    def is_current(self) -> bool:
        """Whether the page has the part as the script makes it."""
        return self.page.read_text("utf-8") == self.current()

    def command(self) -> int:
        """Run the command line of a script: exit status 1 if the page is out of date, --write replaces the part."""
        if sys.argv[1:] == ["--write"]:
            self.page.write_text(self.current(), "utf-8")
            return 0
        if self.is_current():
            return 0
        print(f"{self.page.name} is out of date; run: python docs/tools/{Path(sys.argv[0]).name} --write")
        return 1
