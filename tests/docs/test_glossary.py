"""docs/glossary.md: every term has a meaning and a file that uses it."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LINE = re.compile(r"^\| `([^`]+)` \| ([^|]+) \| `([^`]+)` \|$", re.MULTILINE)


def test_every_term_lives_where_the_glossary_says() -> None:
    """Every term, in any case and with blanks or underscores, occurs in the file that the glossary names."""
    page = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    terms = LINE.findall(page)
    assert len(terms) == len(re.findall(r"^\| `", page, re.MULTILINE)) >= 55
    wrong = []
    for term, meaning, name in terms:
        path = ROOT / name
        text = path.read_text(encoding="utf-8") if path.is_file() else ""
        if term.lower().replace(" ", "") not in re.sub(r"[\s_-]", "", text.lower()):
            wrong.append(f"{term}: not in {name}")
        assert len(meaning.split()) >= 3, term
    assert not wrong, "\n".join(wrong)


def test_no_term_is_listed_twice() -> None:
    terms = [term.lower() for term, _, _ in LINE.findall((ROOT / "docs" / "glossary.md").read_text(encoding="utf-8"))]
    assert len(terms) == len(set(terms))
