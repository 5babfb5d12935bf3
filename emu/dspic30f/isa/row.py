"""Rows and instructions. A row is an instruction form; an instruction is a row with field values."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from .builder import Builder
from .fields import Clause, Field, Operands, Pattern, parse_constraints, parse_pattern, rules_of
from .flow import Flow

Does = Callable[[Builder, Operands], Flow]


@dataclass(frozen=True, eq=False)
class Row:
    """One instruction form: a line of the table.

    id           row number of reference isa.csv
    syntax       operands in assembly order; ``{.B}``: byte form by field B; ``{.W}``: suffix printed, optional in input
    bits, word2  patterns (fields.py); ``word2`` is empty for one-word instructions
    flags        SR bits that the instruction may change; ``Z=s`` is the sticky Z of ADDC and SUBB (isa.md §5)
    does         the instruction's effect, expressed with a Builder
    cycles       number of cycles without stalls, PSV reads, skips or taken branches (isa.md §13.1)
    constraints  rules about field values in addition to the pattern and FIELD_RULES
    repeat_ok    may follow REPEAT (isa.md §7.5)
    psv_class    "mov": a PSV read costs one extra cycle, "other": two (isa.md §13.3)
    """

    id: int
    syntax: str
    bits: str
    flags: str
    does: Does = field(repr=False)
    word2: str = ""
    cycles: int = 1
    constraints: str = ""
    repeat_ok: bool = True
    psv_class: Literal["mov", "other"] = "other"

    @property
    def source(self) -> str:
        """Name the sources of the row: its mnemonic in the programmer's reference manual, its number in isa.csv."""
        return f"PRM {self.mnemonic}; isa.csv {self.id}"

    @cached_property
    def mnemonic(self) -> str:
        """Return the mnemonic in upper case without optional suffix: ADD, BTST.C, DIV.S."""
        return re.split(r"[ {]", self.syntax)[0]

    @cached_property
    def words(self) -> int:
        """Return the length in instruction words."""
        return 2 if self.word2 else 1

    @cached_property
    def pattern(self) -> Pattern:
        """Return the fixed bits and fields of both words."""
        return parse_pattern(self.bits, self.word2) if self.word2 else parse_pattern(self.bits)

    @cached_property
    def fields(self) -> Mapping[str, Field]:
        """Return the fields of the pattern by letter."""
        return {f.letter: f for f in self.pattern.fields}

    @cached_property
    def clauses(self) -> tuple[Clause, ...]:
        """Return all parsed rules: those that the fields imply and the row's own constraints."""
        return rules_of(self.pattern) + parse_constraints(self.constraints)

    def broken(self, x: Operands) -> tuple[Clause, ...]:
        """Return the rules that the field values violate; empty for a legal instruction."""
        return tuple(c for c in self.clauses if not c.holds(lambda letter: getattr(x, letter)))


class Insn:
    """One instruction: its row, field values ``x`` and words. Instructions with equal rows and values are equal."""

    __slots__ = ("_key", "row", "word1", "word2", "x")

    def __init__(self, row: Row, x: Operands, word1: int, word2: int) -> None:
        self.row = row
        self.x = x
        self.word1 = word1
        self.word2 = word2
        self._key = (row.id, *(getattr(x, letter) for letter in row.fields))

    @property
    def words(self) -> int:
        """Return the length in instruction words, 1 or 2."""
        return self.row.words

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Insn) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    def __repr__(self) -> str:
        return f"<{self.row.syntax}: {self.x}>"
