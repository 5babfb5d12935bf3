"""Row of the AVR instruction table: bit pattern, syntax, meaning and cycles of one instruction form.

A pattern has 16 characters without the spaces: `0` and `1` must match, a letter is a field. Letters say what a field
means (FIELDS); the bits of a letter may be scattered. Two-word instructions have `k` as their second word.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

WORD_BITS: Final = 16


@dataclass(frozen=True, slots=True)
class Field:
    """Meaning of a pattern letter: its operand, the first register of its set and the step between two of them."""

    operand: str
    """Operand of the row's syntax and meaning: d, r, K, A, b, q or k."""
    first: int = 0
    step: int = 1


FIELDS: Final[Mapping[str, Field]] = {
    "d": Field("d"),
    "h": Field("d", 16),  # r16 to r31
    "e": Field("d", 16),  # r16 to r23
    "w": Field("d", 24, 2),  # r24, r26, r28, r30
    "p": Field("d", 0, 2),  # even registers
    "r": Field("r"),
    "s": Field("r", 16),
    "t": Field("r", 16),
    "o": Field("r", 0, 2),
    "K": Field("K"),
    "A": Field("A"),
    "b": Field("b"),
    "q": Field("q"),
    "k": Field("k"),
}
"""Meaning of each pattern letter. The AVR instruction set manual names the register set of each instruction."""


@dataclass(frozen=True, eq=False)
class Row:
    """One instruction form.

    syntax   mnemonic and operands as binutils prints them
    bits     pattern of the first word
    flags    SREG bits that the instruction may change
    does     meaning as C statements over the names that README.md of this folder lists
    cycles   cycles without taken branch or skip
    aliases  mnemonics by the value of field b or s, for rows that binutils prints under several names
    words    length in words
    """

    syntax: str
    bits: str
    flags: str
    does: str
    cycles: int = 1
    aliases: tuple[str, ...] = ()
    words: int = 1

    @cached_property
    def mnemonic(self) -> str:
        """Return the mnemonic in lower case."""
        return self.syntax.split()[0]

    @cached_property
    def name(self) -> str:
        """Return a name that is unique in the table and a C identifier: `LD_X_INC` of `ld Rd, X+`."""
        text = self.syntax.replace("-X", "DEC_X").replace("-Y", "DEC_Y").replace("-Z", "DEC_Z").replace("+q", "_q")
        text = re.sub(r"\b(R[dr]|K|A|b|k)\b,?", "", text.replace("+", "_INC"))
        return "_".join(re.findall(r"\w+", text)).upper()

    @cached_property
    def pattern(self) -> str:
        """Return the 16 characters of the pattern."""
        return self.bits.replace(" ", "")

    @cached_property
    def mask(self) -> int:
        """Return the word whose ones are the fixed bits."""
        return int("".join("1" if bit in "01" else "0" for bit in self.pattern), 2)

    @cached_property
    def match(self) -> int:
        """Return the fixed bits of the word."""
        return int("".join("1" if bit == "1" else "0" for bit in self.pattern), 2)

    @cached_property
    def letters(self) -> Mapping[str, tuple[int, ...]]:
        """Return the bit numbers of each field, the most significant first."""
        found: dict[str, tuple[int, ...]] = {}
        for place, letter in enumerate(self.pattern):
            if letter not in "01":
                found[letter] = (*found.get(letter, ()), WORD_BITS - 1 - place)
        return found

    def operands(self, word: int, second: int = 0) -> dict[str, int]:
        """Return the operands by name. `k` is a signed distance in words, or the second word of the instruction."""
        values: dict[str, int] = {}
        for letter, bits in self.letters.items():
            raw = 0
            for bit in bits:
                raw = raw << 1 | word >> bit & 1
            field = FIELDS[letter]
            if field.operand == "k" and self.words == 1 and raw >> (len(bits) - 1):
                raw -= 1 << len(bits)
            values[field.operand] = field.first + field.step * raw
        if self.words > 1:
            values["k"] = second | values.get("k", 0) << WORD_BITS
        return values
