"""Words to instructions and back.

``decode`` accepts exactly the 11,165,253 legal first words of isa.md §4. ``decode_loosely`` also names words that break
a rule of their row, for disassembly; ``decode_for_execution`` is what the CPU obeys.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from .fields import Operands
from .row import Insn, Row
from .table import BY_BYTE

CACHE_WORDS = 1 << 17  # more than twice the flash of the chip


class EncodeError(ValueError):
    """The field values do not fit the row; the text says which and why."""


def _operands(row: Row, word1: int, word2: int) -> Operands:
    x = Operands()
    for field in row.pattern.fields:
        setattr(x, field.letter, field.get(word1, word2))
    return x


def _candidates(word1: int, word2: int) -> list[tuple[int, Insn]]:
    """Rows whose fixed bits match, with the number of rules broken."""
    found = []
    for row in BY_BYTE[word1 >> 16]:
        mask, value = row.pattern.mask, row.pattern.value
        if word1 & mask[0] == value[0] and word2 & mask[1] == value[1]:
            x = _operands(row, word1, word2)
            found.append((len(row.broken(x)), Insn(row, x, word1, word2 if row.word2 else 0)))
    return found


@lru_cache(CACHE_WORDS)
def decode(word1: int, word2: int = 0) -> Insn | None:
    """The instruction in one or two 24-bit words; None if illegal. ``word2`` is ignored by one-word instructions."""
    for broken, insn in _candidates(word1, word2):
        if not broken:
            return insn
    return None


@lru_cache(CACHE_WORDS)
def decode_loosely(word1: int, word2: int = 0) -> Insn | None:
    """As ``decode``, but a word that only breaks rules on field values goes to the row whose rules it breaks least.

    Ties are resolved as binutils prints them: CLR first, then by row number.
    """
    candidates = _candidates(word1, word2)
    if not candidates:
        return None
    return min(candidates, key=lambda c: (c[0], c[1].row.mnemonic != "CLR", c[1].row.id))[1]


@lru_cache(CACHE_WORDS)
def decode_for_execution(word1: int, word2: int = 0) -> Insn | None:
    """As ``decode``, plus word-mode file registers at odd addresses, which run and then trap (isa.md §3.3)."""
    insn = decode(word1, word2)
    if insn is None:
        loose = decode_loosely(word1, word2)
        if loose is not None and all(clause.letter == "f" for clause in loose.row.broken(loose.x)):
            return loose
    return insn


def encode(row: Row, operands: Operands | Mapping[str, int], strict: bool = True) -> tuple[int, ...]:
    """The words of an instruction from field values; fields not given are 0. EncodeError if they break a rule."""
    given = dict(operands) if isinstance(operands, Mapping) else None
    words = list(row.pattern.value)
    x = Operands()
    for field in row.pattern.fields:
        value = given.get(field.letter, 0) if given is not None else getattr(operands, field.letter)
        setattr(x, field.letter, value)
        try:
            bits = field.put(value)
        except ValueError as error:
            raise EncodeError(f"{row.syntax}: field {field.letter}: {error}") from None
        words[0] |= bits[0]
        words[1] |= bits[1]
    if strict:
        for clause in row.broken(x):
            raise EncodeError(f"{row.syntax}: {clause.text} does not hold")
    return tuple(words[: row.words])
