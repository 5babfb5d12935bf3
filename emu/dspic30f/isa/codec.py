"""Codec: decodes program words to instructions, and encodes instructions to program words.

``decode`` accepts exactly the 11,165,253 legal first words of isa.md §4. ``decode_loosely`` is for disassembly: it also
accepts words that break a rule of their row. ``decode_for_execution`` decodes as the CPU does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

from .fields import Clause, Operands
from .row import Insn, Row
from .table import BY_BYTE

CACHE_WORDS = 1 << 17  # number of cached words: more than twice the flash of the chip

# Rules that the CPU does not enforce. A word-mode file register at an odd address causes an address error at run time
# (isa.md §3.3), SFTAC by more than 16 a math error (§8.5). Mode 7 acts as mode 6 (§3.1), and f of CLR WREG is ignored
# (§5.1). A violation of any other rule is an illegal opcode (§4.1). UNVERIFIED except for SFTAC: isa.md §22 items 6, 7,
# 11, 12.
RUNS_ANYWAY = frozenset(("B=0: f even", "k>=-16", "k<=16", "g<=6", "h<=6", "z=0"))


class EncodeError(ValueError):
    """Field values do not fit the row: they break one of its rules, or field ``letter`` cannot hold ``value``."""

    def __init__(self, row: Row, letter: str, value: int, clause: Clause | None, text: str) -> None:
        super().__init__(f"{row.syntax}: {text}")
        self.letter = letter
        self.value = value
        self.clause = clause


def _operands(row: Row, word1: int, word2: int) -> Operands:
    x = Operands()
    for field in row.pattern.fields:
        setattr(x, field.letter, field.get(word1, word2))
    return x


def _candidates(word1: int, word2: int) -> list[tuple[int, Insn]]:
    """Return the rows whose fixed bits match, each with the number of rules that the word breaks."""
    found = []
    for row in BY_BYTE[word1 >> 16]:
        mask, value = row.pattern.mask, row.pattern.value
        if word1 & mask[0] == value[0] and word2 & mask[1] == value[1]:
            x = _operands(row, word1, word2)
            found.append((len(row.broken(x)), Insn(row, x, word1, word2 if row.word2 else 0)))
    return found


@lru_cache(CACHE_WORDS)
def decode(word1: int, word2: int = 0) -> Insn | None:
    """Return the instruction in one or two 24-bit words, None if it is illegal.

    A one-word instruction ignores ``word2``.
    """
    for broken, insn in _candidates(word1, word2):
        if not broken:
            return insn
    return None


@lru_cache(CACHE_WORDS)
def decode_loosely(word1: int, word2: int = 0) -> Insn | None:
    """Decode as ``decode`` does, but also accept words that only break rules about field values.

    The row with the fewest broken rules is used.

    Ties are resolved as binutils does: CLR first, then by row number.
    """
    candidates = _candidates(word1, word2)
    if not candidates:
        return None
    return min(candidates, key=lambda c: (c[0], c[1].row.mnemonic != "CLR", c[1].row.id))[1]


@lru_cache(CACHE_WORDS)
def decode_for_execution(word1: int, word2: int = 0) -> Insn | None:
    """Decode as ``decode`` does, plus the instructions that the CPU executes although assemblers reject them.

    These are the ones that break only rules in RUNS_ANYWAY.
    """
    insn = decode(word1, word2)
    if insn is None:
        loose = decode_loosely(word1, word2)
        if loose is not None and all(clause.text in RUNS_ANYWAY for clause in loose.row.broken(loose.x)):
            return loose
    return insn


def encode(
    row: Row, operands: Operands | Mapping[str, int], tolerate: Sequence[tuple[str, int]] = ()
) -> tuple[int, ...]:
    """Return the words of an instruction with these field values; a field that a mapping lacks is 0.

    Raises EncodeError if they break a rule. ``tolerate`` lists (rule, value) pairs that are permitted.
    """
    words = list(row.pattern.value)
    x = Operands()
    for field in row.pattern.fields:
        letter = field.letter
        value = operands.get(letter, 0) if isinstance(operands, Mapping) else getattr(operands, letter)
        setattr(x, letter, value)
        try:
            bits = field.put(value)
        except ValueError as error:
            raise EncodeError(row, letter, value, None, f"field {letter}: {error}") from None
        words[0] |= bits[0]
        words[1] |= bits[1]
    for clause in row.broken(x):
        value = getattr(x, clause.letter)
        if (clause.text, value) not in tolerate:
            raise EncodeError(row, clause.letter, value, clause, f"{clause.text} does not hold")
    return tuple(words[: row.words])
