"""Candidate loop invariants: relations between machine locations and source values at a loop head.

In: for each visit of the loop head in sample runs, the contents of a register or frame word and the values of the
source.  Out: relations that hold in all of these visits, to be proved by induction.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import z3

from toolchain.proof.ir.operands import either
from toolchain.proof.terms import WORD, Term, vector

FACTORS: Final = (1, -1, 2, -2, 4, -4)
"""Factors of a value in a candidate sum, for pointers that step by 1, 2 or 4 and for decreasing counters."""
MIN_VISITS: Final = 4
"""Minimum number of visits for a candidate with a sum; with fewer, sums hold by coincidence."""


@dataclass(frozen=True)
class ValueWord:
    """A 16-bit word of a source value: key of the value on a path, index of the word, sign or zero extension."""

    key: Any
    number: int = 0
    signed: bool = False

    def term(self, values: Mapping[Any, Any]) -> Term:
        """Return the word as a term."""
        whole = values[self.key][0]
        bits = WORD * (self.number + 1)
        if whole.size() < bits:
            extend = z3.SignExt if self.signed else z3.ZeroExt
            whole = extend(bits - whole.size(), whole)
        return z3.Extract(bits - 1, bits - WORD, whole)


@dataclass(frozen=True)
class Invariant:
    """Invariant: the low `bits` of a location equal a sum of value words, each with a factor, and a number.

    place  a register (0-14), or the address of a frame word
    """

    place: int
    parts: tuple[tuple[int, ValueWord], ...] = ()
    number: int = 0
    bits: int = WORD

    def term(self, values: Mapping[Any, Any]) -> Term:
        """Return the sum as a term."""
        terms = [part.term(values) * vector(factor, WORD) if factor != 1 else part.term(values)
                 for factor, part in self.parts]  # fmt: skip
        if self.number or not terms:
            terms.append(vector(self.number, WORD))
        return z3.simplify(sum(terms[1:], terms[0]))

    def poison(self, values: Mapping[Any, Any]) -> Term | None:
        """Return the condition under which the sum is poison, None if it never is."""
        found = None
        for _, part in self.parts:
            found = either(found, values[part.key][1])
        return found

    def holds(self, held: Term, values: Mapping[Any, Any]) -> Term:
        """Return the condition that the invariant holds for the contents `held` of its location."""
        poison = self.poison(values)
        same = z3.Extract(self.bits - 1, 0, held) == z3.Extract(self.bits - 1, 0, self.term(values))
        return same if poison is None else z3.Or(poison, same)


@dataclass(frozen=True)
class OrderInvariant:
    """Invariant: a word of a source value, or a number, is not greater than another."""

    low: ValueWord | int
    high: ValueWord | int
    signed: bool = False

    def holds(self, values: Mapping[Any, Any]) -> Term:
        """Return the condition that the order holds or that a value is poison."""
        sides = (self.low, self.high)
        a, b = (vector(one, WORD) if isinstance(one, int) else one.term(values) for one in sides)
        poison = None
        for one in sides:
            poison = poison if isinstance(one, int) else either(poison, values[one.key][1])
        same = a <= b if self.signed else z3.ULE(a, b)
        return same if poison is None else z3.Or(poison, same)


def candidate_orders(rows: list[dict[ValueWord, int]], sizes: Mapping[ValueWord, int]) -> Iterator[OrderInvariant]:
    """Yield the order invariants that hold in all `rows` (values at each visit of a loop head).

    A word with the same value in all rows gives two: not greater and not less than that number. A word that changes
    is compared, signed and unsigned, with 0 and with the other words.
    """
    moving = [part for part in rows[0] if len({row[part] for row in rows}) > 1]
    for part, number in rows[0].items():
        if part not in moving:
            yield from (OrderInvariant(part, number), OrderInvariant(number, part))
    whole = [part for part in rows[0] if sizes[part] == WORD]
    others: list[ValueWord | int] = [0, *whole]
    for a in (part for part in moving if part in whole):
        for b in others:
            for low, high in ((a, b), (b, a)):
                for signed in (True, False):
                    flip = 0x8000 if signed else 0
                    pairs = [(_number(low, row) ^ flip, _number(high, row) ^ flip) for row in rows]
                    if a != b and (low != 0 or signed) and all(x <= y for x, y in pairs):
                        yield OrderInvariant(low, high, signed)


def _number(one: ValueWord | int, row: dict[ValueWord, int]) -> int:
    return one if isinstance(one, int) else row[one]


def words_of(key: Any, value: tuple[Term, Term | None]) -> Iterator[tuple[ValueWord, int]]:
    """Yield the words of a value with the number of bits of each that belong to the value."""
    whole, rest = divmod(value[0].size(), WORD)
    yield from ((ValueWord(key, n), WORD) for n in range(whole))
    if rest:
        yield from ((ValueWord(key, whole, signed), rest) for signed in (False, True))


def candidate_invariants(
    place: int, held: list[int], rows: list[dict[ValueWord, int]], sizes: Mapping[ValueWord, int]
) -> Iterator[Invariant]:
    """Yield candidate invariants of one location.

    held   contents of the location at each visit
    rows   numbers of the value words at each visit
    sizes  by word, the number of bits that belong to the value
    """
    exact = False
    for part in rows[0]:
        if all(row[part] == number for row, number in zip(rows, held, strict=True)):
            exact = True
            yield Invariant(place, ((1, part),))
        elif not part.signed and sizes[part] < WORD:
            mask = (1 << sizes[part]) - 1
            if all((row[part] ^ number) & mask == 0 for row, number in zip(rows, held, strict=True)):
                yield Invariant(place, ((1, part),), 0, sizes[part])
    if len(set(held)) == 1:
        yield Invariant(place, (), held[0])
    elif not exact and len(rows) >= MIN_VISITS:
        yield from _sums(place, held, rows)


def _sums(place: int, held: list[int], rows: list[dict[ValueWord, int]]) -> Iterator[Invariant]:
    """Yield candidate sums: one value plus a number, or two values, one of them with a factor, plus a number."""
    moving = [part for part in rows[0] if len({row[part] for row in rows}) > 1]
    for a in moving:
        number = _constant_difference(held, [row[a] for row in rows])
        if number is not None:
            yield Invariant(place, ((1, a),), number)
    for n, a in enumerate(moving):
        for k, b in enumerate(moving):
            for factor in FACTORS:
                if n < k or (n > k and factor != 1):
                    number = _constant_difference(held, [row[a] + factor * row[b] for row in rows])
                    if number is not None:
                        yield Invariant(place, ((1, a), (factor, b)), number)
    for a in moving:
        for factor in FACTORS[1:]:
            number = _constant_difference(held, [factor * row[a] for row in rows])
            if number is not None:
                yield Invariant(place, ((factor, a),), number)


def _constant_difference(held: list[int], sums: list[int]) -> int | None:
    """Return the difference between contents and sums if it is the same at all visits, else None."""
    rests = {(number - total) & 0xFFFF for number, total in zip(held, sums, strict=True)}
    return rests.pop() if len(rests) == 1 else None
