"""Word-by-word comparison of two independent descriptions of the instruction set (docs/census.md)."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from emu.dspic30f.isa.row import Row
from emu.dspic30f.isa.table import ROWS
from tests.emu.isa.samples import random_insn

pytest.importorskip("pypcode", reason="the independent decoder is not installed (extra: test)")

from tests.emu.isa.sleigh import disagreement

PAGE = Path(__file__).resolve().parents[3] / "docs" / "census.md"
RANDOM_WORDS = 40_000
PER_ROW = 40


def explained_classes() -> set[str]:
    """Return the classes of disagreement in the table of docs/census.md."""
    return set(re.findall(r"^\| ([^|]+?) \| [\d,]+ \|", PAGE.read_text(), re.MULTILINE))


def test_random_words_disagree_only_as_the_page_explains() -> None:
    """In a sample of random words, all disagreements are of classes in docs/census.md. The campaign census_sleigh.py
    in tests/fuzz/emulator compares all 2**24 words."""
    generator = random.Random(30)
    known = explained_classes()
    for word in (generator.getrandbits(24) for _ in range(RANDOM_WORDS)):
        name = disagreement(word)
        assert name is None or name in known, f"{word:06x}: {name}"


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.id}-{row.mnemonic}")
def test_instructions_of_each_row_disagree_only_as_the_page_explains(row: Row) -> None:
    """Disagreements on random instructions of each row, with both words of two-word instructions, are of classes in
    docs/census.md."""
    generator = random.Random(row.id)
    known = explained_classes()
    for _ in range(PER_ROW):
        insn = random_insn(row, generator)
        name = disagreement(insn.word1, insn.word2)
        assert name is None or name in known, f"{insn.word1:06x} {insn.word2:06x}: {name}"


def test_no_word_is_legal_here_and_unknown_there() -> None:
    """docs/census.md: SLEIGH decodes every word that is legal in the table."""
    assert "not decoded by SLEIGH" not in explained_classes()
