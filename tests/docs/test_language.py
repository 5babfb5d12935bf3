"""Spelling of all texts, British spelling and length of sentences on the pages."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import codespell_lib
import pytest
from markdown_it import MarkdownIt

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 40
"""Maximum number of words of a sentence, or of its part before a colon or semicolon."""
AMERICAN = (
    "program", "sanitizer", "sanitizers", "writable", "biased", "practice", "license", "math", "analog", "meter",
    "color", "recognized", "synthesize",
)  # fmt: skip
"""American words that are terms, names of files, or quotations: `math.h`, `analog` inputs of a data sheet."""
DATA = ("docs/reference/", "docs/plain-registers.md")
"""Pages of data, whose enumerations are no sentences."""
PARSER = MarkdownIt("commonmark").enable("table")


def tracked(*patterns: str) -> list[str]:
    """Return the tracked text files that match the patterns, as paths below the root; all of them without a pattern."""
    words = ["git", "grep", "-Iz", "--name-only", "--cached", "-e", "", "--", *patterns]
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [name for name in listed.split("\0") if name and (ROOT / name).is_file()]


def misspelt(files: list[str], *options: str) -> list[str]:
    """Return the lines that codespell prints for misspelt words in the files."""
    words = [sys.executable, "-m", "codespell_lib", "--toml", str(ROOT / "pyproject.toml"), *options, *files]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False).stdout.splitlines()


def sentences(page: str) -> Iterator[str]:
    """Yield the sentences of a page's paragraphs and lists; code in them is one word."""
    in_table = False
    for token in PARSER.parse(page):
        in_table = token.type != "table_close" and (in_table or token.type == "table_open")
        if token.type == "inline" and not in_table:
            parts = [{"text": one.content, "code_inline": "code"}.get(one.type, " ") for one in token.children or ()
                     if one.type in ("text", "code_inline", "softbreak", "hardbreak")]  # fmt: skip
            yield from re.split(r"(?<=[.!?:;])\s+", "".join(parts))


def too_long(page: str) -> list[str]:
    """Return the sentences of a page with more than LONGEST words."""
    return [one for one in sentences(page) if len(re.findall(r"\w[\w'’-]*", one)) > LONGEST]


def test_words_are_spelt_right() -> None:
    """codespell finds no misspelt word in any file: pages, code, comments, messages."""
    assert misspelt(tracked()) == []


def test_pages_are_in_british_spelling(tmp_path: Path) -> None:
    """codespell's list from American to British spelling finds no word on the pages."""
    american = tmp_path / "american.txt"
    source = Path(codespell_lib.__file__).parent / "data" / "dictionary_en-GB_to_en-US.txt"
    pairs = [line.partition("->") for line in source.read_text("utf-8").splitlines()]
    american.write_text("".join(f"{us.strip()}->{gb}\n" for gb, _, text in pairs for us in text.split(",") if us))
    options = ("-D", str(american), "--ignore-regex", "`[^`]*`", "--ignore-words-list", ",".join(AMERICAN))
    assert misspelt(tracked("*.md"), *options) == []
    page = tmp_path / "page.md"
    page.write_text("The center of `color`.\n")
    assert [line.partition(": ")[2] for line in misspelt([str(page)], *options)] == ["center ==> centre"]


def test_a_misspelt_word_is_found(tmp_path: Path) -> None:
    """A misspelt word is reported with its line."""
    page = tmp_path / "page.md"
    page.write_text("first\n" + "rec" + "ieve\n")
    assert [line.partition("page.md:")[2] for line in misspelt([str(page)])] == ["2: rec" + "ieve ==> receive"]


@pytest.mark.parametrize("page", [one for one in tracked("*.md") if not one.startswith(DATA)])
def test_sentences_are_short(page: str) -> None:
    """No sentence of a page has more than 40 words."""
    assert too_long((ROOT / page).read_text("utf-8")) == []


def test_a_long_sentence_is_found() -> None:
    """41 words are too many, 40 are not; code counts as one word, tables and fenced code are not counted."""
    words = " ".join(["word"] * 39)
    assert too_long(f"- {words} `a b c`.\n") == []
    assert too_long(f"{words} more `a b`\n") == [f"{words} more code"]
    assert too_long(f"| a |\n|---|\n| {words} more words |\n\n```\n{words} more words\n```\n") == []
