"""Conversions from words to fields and back, and from text to fields and back, are identities."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emu.dspic30f.isa import codec, text
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.row import Insn, Row
from emu.dspic30f.isa.table import ROWS
from tests.emu.isa.samples import idle_fields, random_insn

SAMPLES = 60


def with_default_fields(insn: Insn) -> Insn:
    """Return the instruction with unused fields as an assembler writes them."""
    values = {letter: getattr(insn.x, letter) for letter in insn.row.fields} | idle_fields(insn)
    again = codec.decode(*codec.encode(insn.row, values))
    assert again is not None
    return again


def check_words(insn: Insn) -> None:
    """Check that decode∘encode is the identity on fields, and encode∘decode on all bits that are not ignored."""
    words = codec.encode(insn.row, insn.x)
    assert codec.decode(*words) == insn
    given_words = (insn.word1, insn.word2)[: insn.words]
    used = [
        mask | sum(r.mask << r.shift for f in insn.row.pattern.fields for r in f.runs if r.word == i)
        for i, mask in enumerate(insn.row.pattern.mask)
    ]
    assert all(a & m == b & m for a, b, m in zip(words, given_words, used, strict=False))


def check_text(insn: Insn, pc: int) -> None:
    """Check that parse∘format is the identity on instructions, and format∘parse on texts."""
    plain = with_default_fields(insn)
    written = text.format(plain, pc, source=True)
    words = text.parse(written).encode(pc)
    again = codec.decode(*words)
    assert again == plain, written
    assert text.format(again, pc, source=True) == written


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.id}-{row.mnemonic}")
def test_random_instructions_of_each_row_survive_both_round_trips(row: Row) -> None:
    """Random instructions of every row, however few words it has, survive both round trips."""
    generator = random.Random(row.id)
    for _ in range(SAMPLES):
        insn = random_insn(row, generator)
        if row.mnemonic == "DO" and insn.x.n in (-2, -1, 0):
            continue  # legal as a word, but refused as text: isa.md §7.6
        check_words(insn)
        check_text(insn, generator.randrange(0, 0x18000, 2))


@settings(max_examples=2000, deadline=None)
@given(st.integers(0, (1 << 24) - 1), st.integers(0, 0xFFFF), st.integers(0, 0xBFFF))
def test_any_legal_word_survives_both_round_trips(word1: int, word2: int, slot: int) -> None:
    """isa.md §4: any legal first word survives both round trips."""
    insn = codec.decode(word1, word2)
    if insn is None or (insn.row.mnemonic == "DO" and insn.x.n in (-2, -1, 0)):
        return
    check_words(insn)
    check_text(insn, 2 * slot)


@settings(max_examples=500, deadline=None)
@given(st.sampled_from(ROWS), st.data())
def test_encode_refuses_values_that_do_not_fit_their_field(row: Row, data: st.DataObject) -> None:
    """`encode` raises an error for a value that does not fit its field."""
    if not row.fields:
        return
    field = row.fields[data.draw(st.sampled_from(sorted(row.fields)))]
    low, high = field.limits
    value = data.draw(st.one_of(st.integers(low - 1000, low - 1), st.integers(high + 1, high + 1000)))
    x = Operands(**dict.fromkeys(row.fields, 0) | {field.letter: value})
    with pytest.raises(codec.EncodeError):
        codec.encode(row, x)
