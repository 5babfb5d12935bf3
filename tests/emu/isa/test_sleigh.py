"""Two independent descriptions of the instruction set, compared word by word (docs/census.md)."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from samples import random_insn

from emu.dspic30f.isa.row import Row
from emu.dspic30f.isa.table import ROWS

pytest.importorskip("pypcode", reason="the independent decoder is not installed (extra: test)")

from sleigh import disagreement

PAGE = Path(__file__).resolve().parents[3] / "docs" / "census.md"
RANDOM_WORDS = 40_000
PER_ROW = 40


def explained() -> set[str]:
    """Return the classes in the table of docs/census.md."""
    return set(re.findall(r"^\| ([^|]+?) \| [\d,]+ \|", PAGE.read_text(), re.MULTILINE))


def test_random_words_disagree_only_as_the_page_explains() -> None:
    """All 2**24 words were compared once (tests/fuzz/emulator/census_sleigh.py); this is a sample."""
    generator = random.Random(30)
    known = explained()
    for word in (generator.getrandbits(24) for _ in range(RANDOM_WORDS)):
        name = disagreement(word)
        assert name is None or name in known, f"{word:06x}: {name}"


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.id}-{row.mnemonic}")
def test_instructions_of_each_row_disagree_only_as_the_page_explains(row: Row) -> None:
    """Both words of two-word instructions are compared."""
    generator = random.Random(row.id)
    known = explained()
    for _ in range(PER_ROW):
        insn = random_insn(row, generator)
        name = disagreement(insn.word1, insn.word2)
        assert name is None or name in known, f"{insn.word1:06x} {insn.word2:06x}: {name}"


def test_no_word_is_legal_here_and_unknown_there() -> None:
    """docs/census.md: SLEIGH decodes every legal word."""
    assert "not decoded by SLEIGH" not in explained()
