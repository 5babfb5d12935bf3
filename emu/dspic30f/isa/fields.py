"""Bit fields: notation of 24-bit patterns, and meaning of each letter in a pattern.

A pattern is 24 characters without spaces: ``0``/``1`` must match, ``-`` is ignored by the CPU, a letter is a field.
Letters follow isa.md §4.2 with three differences, so that each letter has one meaning: ``o`` is the signed offset of
``[Wn+Slit10]``, ``z`` must be 0, and the f-bit forms show the 13-bit byte address ``f`` and the bit ``b``, 0..7, that
the hardware uses.
A field's *value* is its operand: signed, and scaled to a byte address or register number.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import eq, ge, gt, le, lt, ne
from typing import Any

# (letter, width) -> (signed, scale). Fields that are not listed are unsigned with scale 1. isa.md §3.2, §3.3, §4.2.
INTERPRETATION: Mapping[tuple[str, int], tuple[bool, int]] = {
    ("f", 15): (False, 2),  # MOV f,Wnd  PUSH f: word address anywhere in the 64 KB
    ("d", 3): (False, 2),  # even register of MUL, MOV.D
    ("s", 3): (False, 2),  # even register of MOV.D Wns
    ("k", 13): (False, 2),  # LNK: even frame size
    ("k", 6): (True, 1),  # SFTAC: Slit6
    ("r", 4): (True, 1),  # accumulator pre-shift: Slit4
    ("o", 10): (True, 1),  # Slit10, in elements of the access size
    ("n", 16): (True, 1),  # branch offset in words
    ("n", 22): (False, 2),  # CALL, GOTO: program address; the second word holds the high part
}

# Rules that a field implies in every row: (letter, width or None for any, other letter needed) -> clause.
# Reserved modes isa.md §3.1; word alignment, byte literals and byte bits §3.2, §3.3; MAC operands §8.1.
FIELD_RULES: tuple[tuple[str, int | None, str, str], ...] = (
    ("p", None, "", "p<=5"),
    ("q", None, "", "q<=5"),
    ("g", None, "", "g<=6"),
    ("h", None, "", "h<=6"),
    ("f", 13, "B", "B=0: f even"),
    ("k", 10, "B", "B=1: k<=255"),
    ("b", 4, "B", "B=1: b<=7"),
    ("m", 3, "", "m!=3; m!=7"),
    ("a", None, "", "a<=2"),
    ("z", None, "", "z=0"),
)


class Operands:
    """Decoded fields of one instruction, by letter. Reading a letter that the row lacks raises AttributeError."""

    __slots__ = tuple("ABabdfghijkmnopqrstvwxyz")
    A: int  # 0 ACCA, 1 ACCB
    B: int  # 0 word, 1 byte
    a: int  # accumulator write-back: 0 W13, 1 [W13]+=2, 2 none
    b: int  # bit number
    d: int  # destination register
    f: int  # file address, bytes
    g: int  # source mode of the 8-mode set
    h: int  # destination mode of the 8-mode set
    i: int  # X prefetch
    j: int  # Y prefetch
    k: int  # literal
    m: int  # MAC multiplicands
    n: int  # branch offset in words; program address in CALL, GOTO
    o: int  # offset of [Wn+lit], in elements
    p: int  # source mode
    q: int  # destination mode
    r: int  # accumulator shift, -8..7, positive is right
    s: int  # source register
    t: int  # DIV dividend, high register
    v: int  # DIV dividend, low register
    w: int  # Wb register
    x: int  # X prefetch destination, W4 + x
    y: int  # Y prefetch destination, W4 + y
    z: int  # assembled as 0, ignored by the CPU

    def __init__(self, **fields: int) -> None:
        for letter, value in fields.items():
            setattr(self, letter, value)

    def __repr__(self) -> str:
        return " ".join(f"{c}={getattr(self, c)}" for c in self.__slots__ if hasattr(self, c))


@dataclass(frozen=True, slots=True)
class Run:
    """Contiguous part of a field: the bits ``mask`` at ``shift`` in word number ``word``, with weight 2**``weight``."""

    word: int
    shift: int
    mask: int
    weight: int


@dataclass(frozen=True, slots=True)
class Field:
    """One letter of a pattern: the positions of its bits and their interpretation as a number."""

    letter: str
    width: int
    runs: tuple[Run, ...]
    signed: bool
    scale: int

    def get(self, word1: Any, word2: Any = 0) -> Any:
        """Return the field's value in instruction words, which may be numpy arrays."""
        words = (word1, word2)
        raw = 0
        for run in self.runs:
            raw = raw | (words[run.word] >> run.shift & run.mask) << run.weight
        if self.signed:
            sign = 1 << self.width - 1
            raw = (raw ^ sign) - sign
        return raw * self.scale

    def put(self, value: int) -> tuple[int, int]:
        """Return the bits to OR into both words.

        Raises ValueError if ``value`` is out of range or not a multiple of the scale.
        """
        low, high = self.limits
        if not low <= value <= high or value % self.scale:
            step = f" in steps of {self.scale}" if self.scale > 1 else ""
            raise ValueError(f"{value} is not in {low}..{high}{step}")
        raw = value // self.scale & (1 << self.width) - 1
        words = [0, 0]
        for run in self.runs:
            words[run.word] |= (raw >> run.weight & run.mask) << run.shift
        return words[0], words[1]

    @property
    def limits(self) -> tuple[int, int]:
        """Return the smallest and the largest value of the field."""
        span = 1 << self.width
        low, high = (-span // 2, span // 2 - 1) if self.signed else (0, span - 1)
        return low * self.scale, high * self.scale


@dataclass(frozen=True, slots=True)
class Pattern:
    """One or two instruction words described as fixed bits and fields."""

    mask: tuple[int, int]
    value: tuple[int, int]
    fields: tuple[Field, ...]


def parse_pattern(*words: str) -> Pattern:
    """Parse the pattern of the first and, for two-word instructions, of the second word."""
    mask, value = [0, 0], [0, 0]
    runs: dict[str, list[Run]] = {}
    widths: dict[str, int] = {}
    for word in reversed(range(len(words))):  # the second word holds the high part of a field in both words
        text = words[word].replace(" ", "")
        assert len(text) == 24, words[word]
        for match in reversed(list(re.finditer(r"0+|1+|-+|([A-Za-z])\1*", text))):
            shift, width = 24 - match.end(), match.end() - match.start()
            ones = (1 << width) - 1
            letter = match[0][0]
            if letter in "01":
                mask[word] |= ones << shift
                value[word] |= int(letter) * ones << shift
            elif letter != "-":
                runs.setdefault(letter, []).append(Run(word, shift, ones, 0))
                widths[letter] = widths.get(letter, 0) + width
    fields = []
    for letter, pieces in runs.items():
        placed, weight = [], 0
        for piece in sorted(pieces, key=lambda r: (r.word, r.shift)):
            placed.append(Run(piece.word, piece.shift, piece.mask, weight))
            weight += piece.mask.bit_length()
        signed, scale = INTERPRETATION.get((letter, weight), (False, 1))
        fields.append(Field(letter, weight, tuple(placed), signed, scale))
    return Pattern((mask[0], mask[1]), (value[0], value[1]), tuple(fields))


COMPARISONS: Mapping[str, Callable[[Any, Any], Any]] = {"<=": le, ">=": ge, "!=": ne, "=": eq, "<": lt, ">": gt}
CLAUSE = re.compile(r"(?:(\w)=(\d+): )?(\w)(?: (even)|(<=|>=|!=|=)(?:(-?\d+)|(\w)\+(\d+)))")


@dataclass(frozen=True, slots=True)
class Clause:
    """Rule about field values, e.g. ``B=1: k<=255`` or ``v even``. It holds if its condition does not apply."""

    text: str
    when: tuple[str, int] | None
    letter: str
    relation: str  # a key of COMPARISONS, or "even"
    other: str | None  # compare with this field plus ``number``; None: compare with ``number``
    number: int

    def holds(self, get: Callable[[str], Any]) -> Any:
        """Return whether the rule holds. ``get(letter)`` returns a field's value as an int or a numpy array."""
        value = get(self.letter)
        if self.relation == "even":
            good = value % 2 == 0
        else:
            good = COMPARISONS[self.relation](value, self.number + (get(self.other) if self.other else 0))
        return good if self.when is None else (get(self.when[0]) != self.when[1]) | good


def rules_of(pattern: Pattern) -> tuple[Clause, ...]:
    """Return the rules that the fields of a pattern imply."""
    widths = {field.letter: field.width for field in pattern.fields}
    texts = [
        text
        for letter, width, needed, text in FIELD_RULES
        if letter in widths and width in (None, widths[letter]) and (not needed or needed in widths)
    ]
    return parse_constraints("; ".join(texts))


def parse_constraints(text: str) -> tuple[Clause, ...]:
    """Parse rules separated by ``;``, all of which must hold."""
    clauses = []
    for part in filter(None, (p.strip() for p in text.split(";"))):
        match = CLAUSE.fullmatch(part)
        assert match, part
        condition, is_value, letter, even, relation, number, other, plus = match.groups()
        when = (condition, int(is_value)) if condition else None
        clauses.append(Clause(part, when, letter, even or relation, other, int(number or plus or 0)))
    return tuple(clauses)
