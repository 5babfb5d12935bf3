"""Citations such as `isa.md §14.4` in code and pages refer to a heading of a page in this repository."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("docs/reference", "docs/design", "docs")
"""Folders that are searched for a cited page, in this order."""
SECTIONS = r"(?:§\s?[0-9]+(?:\.[0-9]+)*(?:(?:,| and|-| to)\s?(?=§))?\s?)+"
CITATION = re.compile(rf"\b([a-z0-9][a-z0-9-]*)\.md`?,?\s+({SECTIONS})")
NUMBER = re.compile(r"§\s?([0-9]+(?:\.[0-9]+)*)")
HEADING = re.compile(r"^#{1,6} +(?:§ ?)?([0-9]+(?:\.[0-9]+)*)\.? ", re.MULTILINE)
SUFFIXES = {".py", ".c", ".h", ".S", ".s", ".md", ".toml", ".inc", ".csv", ".html", ".mk", ".ts"}


def page_of(name: str) -> Path | None:
    """Return the page that a citation names, or None if the repository has none."""
    return next((path for folder in FOLDERS if (path := ROOT / folder / f"{name}.md").is_file()), None)


@cache
def sections(page: Path) -> frozenset[str]:
    """Return the numbers of a page's headings: {"14", "14.4", ...}."""
    return frozenset(HEADING.findall(page.read_text(encoding="utf-8")))


def citations(text: str) -> Iterator[tuple[str, str]]:
    """Yield page and section of every citation in a text. A citation may contain a line break or a comment sign."""
    joined = re.sub(r"\s*\n\s*(?:#|//|\*|;)?\s*", " ", text)
    for name, numbers in CITATION.findall(joined):
        for number in NUMBER.findall(numbers):
            yield name, number


def unresolved(text: str) -> list[str]:
    """Return the citations in a text that refer to no heading."""
    found = []
    for name, number in citations(text):
        page = page_of(name)
        if page is None:
            found.append(f"{name}.md: no such page in {', '.join(FOLDERS)}")
        elif number not in sections(page):
            found.append(f"{name}.md §{number}: {page.relative_to(ROOT)} has no heading with this number")
    return found


def test_every_citation_leads_to_a_heading() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    lost, count = [], 0
    for name in listed.splitlines():
        path = ROOT / name
        if path.suffix not in SUFFIXES or name == "CHANGELOG.md" or path == Path(__file__) or not path.is_file():
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        count += sum(1 for _ in citations(text))
        lost += [f"{name}: {one}" for one in unresolved(text)]
    assert not lost, "\n".join(lost)
    assert count > 1000  # the pattern still finds citations


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("the stall (isa.md §13.2)", [("isa", "13.2")]),
        ("`isa.md` §6.7, §7.5: both", [("isa", "6.7"), ("isa", "7.5")]),
        ("# see epuck.md\n# §7.4 for it", [("epuck", "7.4")]),
    ],
)
def test_citations_are_found(text: str, expected: list[tuple[str, str]]) -> None:
    assert list(citations(text)) == expected


def test_a_wrong_citation_is_reported() -> None:
    assert unresolved("isa.md §99.1") == ["isa.md §99.1: docs/reference/isa.md has no heading with this number"]
    assert unresolved("nothing.md §1") == ["nothing.md: no such page in docs/reference, docs/design, docs"]
