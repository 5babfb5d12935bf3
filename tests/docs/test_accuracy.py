"""docs/accuracy.md lists every fact that the code marks as unverified on silicon."""

from __future__ import annotations

import re
from pathlib import Path

import unverified

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "accuracy.md").read_text(encoding="utf-8")


def test_a_mark_in_any_kind_of_comment_is_found(tmp_path):
    """Marks in docstrings, trailing comments and comment groups of Python, C and assembly become rows."""
    python = tmp_path / "a.py"
    python.write_text('"""One. UNVERIFIED: a fact of\nmore than sixty characters, which needs two lines."""\n'
                      "LIMIT = 3  # UNVERIFIED: guessed\n# first\n# UNVERIFIED: in a group\n")  # fmt: skip
    c = tmp_path / "a.c"
    c.write_text("/* Two\n * lines, UNVERIFIED. */\nint a = 1; /* UNVERIFIED: guessed */\n")
    assembly = tmp_path / "a.S"
    assembly.write_text("; One line,\n; UNVERIFIED on silicon.\n")
    assert [fact for path in (python, c, assembly) for fact in unverified.facts(path)] == [
        "UNVERIFIED: a fact of more than sixty characters, which needs two lines.",
        "`LIMIT = 3`: UNVERIFIED: guessed",
        "first UNVERIFIED: in a group",
        "Two lines, UNVERIFIED.",
        "`int a = 1;`: UNVERIFIED: guessed",
        "One line, UNVERIFIED on silicon.",
    ]


def test_every_file_the_page_names_exists():
    names = re.findall(r"`((?:emu|isa|toolchain|firmware|arena|docs|tests)/[\w./-]+)", PAGE)
    assert len(names) > 40
    for name in names:
        path = ROOT / ("emu/dspic30f/" + name if name.startswith("isa/") else name)
        assert path.exists(), name


def test_all_open_points_of_the_core_have_a_row():
    """docs/accuracy.md has a row for each of the open points 1 to 28 of isa.md §22."""
    table = PAGE.split("## Open points of the core")[1].split("Beyond that list")[0]
    assert [int(number) for number in re.findall(r"^\| (\d+) \|", table, re.MULTILINE)] == list(range(1, 29))
