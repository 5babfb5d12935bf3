"""The space of all first words: the legal ones are those of the reference, and no two rows claim the same word
(isa.md §4, §4.1)."""

from __future__ import annotations

import csv
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from emu.dspic30f.isa import codec
from emu.dspic30f.isa.row import Row
from emu.dspic30f.isa.table import BY_BYTE, BY_ID, ROWS

LEGAL_WORDS = 11_165_253  # isa.md §4
REFERENCE = Path(__file__).resolve().parents[2] / "vectors"


def words_of_row(row: Row, words: np.ndarray) -> np.ndarray:
    """Return the words that belong to a row: fixed bits and rules match."""
    mine = (words & row.pattern.mask[0]) == row.pattern.value[0]
    for clause in row.clauses:
        mine &= clause.holds(lambda letter: row.fields[letter].get(words))
    return mine


@cache
def census() -> tuple[np.ndarray, dict[int, int]]:
    """Return the number of rows for each first word, and the number of words for each row."""
    rows_per_word = np.zeros(1 << 24, dtype=np.uint8)
    words_per_row: Counter[int] = Counter()
    for byte, bucket in enumerate(BY_BYTE):
        words = np.arange(byte << 16, byte + 1 << 16, dtype=np.int64)
        for row in bucket:
            mine = words_of_row(row, words)
            rows_per_word[byte << 16 : byte + 1 << 16] += mine
            words_per_row[row.id] += int(mine.sum())
    return rows_per_word, dict(words_per_row)


def test_the_number_of_legal_first_words_is_that_of_the_reference() -> None:
    """isa.md §4: the number of legal first words among all 2**24 is that of the reference."""
    assert int((census()[0] > 0).sum()) == LEGAL_WORDS


def test_no_word_is_claimed_by_two_rows() -> None:
    """isa.md §4: no first word belongs to two rows."""
    doubled = np.flatnonzero(census()[0] > 1)
    assert not len(doubled), [f"{word:06x}" for word in doubled[:10]]


def test_every_row_claims_words() -> None:
    """Every row has at least one word."""
    assert set(census()[1]) == set(BY_ID)
    assert all(census()[1].values())


def test_decode_agrees_with_the_census() -> None:
    """``decode``, which handles one word at a time, agrees with the census, which uses arrays."""
    generator = np.random.default_rng(20)
    for word in map(int, generator.integers(0, 1 << 24, 20_000)):
        assert (codec.decode.__wrapped__(word) is not None) == bool(census()[0][word]), f"{word:06x}"


def test_legal_words_per_opcode_byte_are_those_of_the_reference() -> None:
    """isa.md §4, legal_words.csv: the number of legal words among the 65,536 of each opcode byte is that of the
    reference."""
    checked = 0
    with open(REFERENCE / "legal_words.csv", newline="") as lines:
        for line in csv.DictReader(lines):
            for byte in range(int(line["first"], 16), int(line["last"], 16) + 1):
                legal = int((census()[0][byte << 16 : byte + 1 << 16] > 0).sum())
                assert legal == int(line["legal"]), f"opcode byte {byte:02x}"
                checked += 1
    assert checked == 256


@cache
def reference_rows() -> dict[int, dict[str, str]]:
    """Return the base rows of isa.csv by number."""
    with open(REFERENCE / "isa.csv", newline="") as lines:
        return {int(row["id"]): row for row in csv.DictReader(lines) if row["status"] == "base"}


def fixed_bits(pattern: str) -> tuple[int, int]:
    mask = int("".join("1" if c in "01" else "0" for c in pattern) or "0", 2)
    return mask, int("".join(c if c in "01" else "0" for c in pattern) or "0", 2)


def test_the_table_has_the_rows_of_the_reference() -> None:
    """isa.csv: the table has the 226 base forms and 83 mnemonics of the reference."""
    assert set(BY_ID) == set(reference_rows())
    assert len(ROWS) == 226


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.id}-{row.mnemonic}")
def test_bits_cycles_flags_and_repeat_are_those_of_the_reference(row: Row) -> None:
    """isa.csv: columns word1, word2, words, cycles, repeat, psv_extra and the flags equal those of the table."""
    reference = reference_rows()[row.id]
    masks, values = zip(fixed_bits(reference["word1"]), fixed_bits(reference["word2"]), strict=True)
    zeros = sum(run.mask << run.shift for run in row.fields["z"].runs) if "z" in row.fields else 0
    assert (row.pattern.mask[0] | zeros, row.pattern.mask[1]) == masks
    assert row.pattern.value == values
    assert row.words == int(reference["words"])
    assert row.cycles == int(reference["cycles"].split()[0])
    assert row.repeat_ok == (reference["repeat"] != "no")
    if reference["psv_extra"][:1] in ("1", "2"):
        assert row.psv_class == ("mov" if reference["psv_extra"][0] == "1" else "other")
    flags = [f if reference[f] != "s" else f"{f}=s" for f in ("DC", "N", "OV", "Z", "C") if reference[f] != "-"]
    sticky_too = row.mnemonic == "MPY.N"  # MPY.N has the flags of MPY: isa.md §22 item 20
    flags += [f for f in ("OA", "OB", "SA", "SB") if reference[f] != "-" or sticky_too]
    assert row.flags.split() == flags
