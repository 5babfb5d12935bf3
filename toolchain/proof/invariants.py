"""What the machine may hold at a loop's first block: guesses from numbers, to be proved.

In: for each time a few inputs come there, what a register or a word of the frame holds and what the source's values
are. Out: claims that are true of all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import z3

from toolchain.proof.ir.operands import either
from toolchain.proof.terms import WORD, Term, vector

FACTORS: Final = (1, -1, 2, -2, 4, -4)
"""What a value is multiplied by in a sum: steps of pointers, and counts that go down."""
FEWEST: Final = 4
"""Times the machine must have been there before a sum is guessed, which chance could make."""


@dataclass(frozen=True)
class Part:
    """A word of a value: its key on a path, its number, and whether above a short value stands its sign."""

    key: Any
    number: int = 0
    signed: bool = False

    def term(self, values: Mapping[Any, Any]) -> Term:
        """16 bits."""
        whole = values[self.key][0]
        bits = WORD * (self.number + 1)
        if whole.size() < bits:
            extend = z3.SignExt if self.signed else z3.ZeroExt
            whole = extend(bits - whole.size(), whole)
        return z3.Extract(bits - 1, bits - WORD, whole)


@dataclass(frozen=True)
class Claim:
    """A register (0-14) or a word of the frame (its address) holds a sum of parts, by factors, and a number; of that
    its low `bits` are told."""

    place: int
    parts: tuple[tuple[int, Part], ...] = ()
    number: int = 0
    bits: int = WORD

    def term(self, values: Mapping[Any, Any]) -> Term:
        """What it holds."""
        terms = [part.term(values) * vector(factor, WORD) if factor != 1 else part.term(values)
                 for factor, part in self.parts]  # fmt: skip
        if self.number or not terms:
            terms.append(vector(self.number, WORD))
        return z3.simplify(sum(terms[1:], terms[0]))

    def poison(self, values: Mapping[Any, Any]) -> Term | None:
        """When it says nothing."""
        found = None
        for _, part in self.parts:
            found = either(found, values[part.key][1])
        return found

    def holds(self, held: Term, values: Mapping[Any, Any]) -> Term:
        """That it is true of what the place holds."""
        poison = self.poison(values)
        same = z3.Extract(self.bits - 1, 0, held) == z3.Extract(self.bits - 1, 0, self.term(values))
        return same if poison is None else z3.Or(poison, same)


@dataclass(frozen=True)
class Order:
    """Among the source's own values, by words, and numbers: that one is not above another, signed or not."""

    low: Part | int
    high: Part | int
    signed: bool = False

    def holds(self, values: Mapping[Any, Any]) -> Term:
        """It, or one of them is poison."""
        sides = (self.low, self.high)
        a, b = (vector(one, WORD) if isinstance(one, int) else one.term(values) for one in sides)
        poison = None
        for one in sides:
            poison = poison if isinstance(one, int) else either(poison, values[one.key][1])
        same = a <= b if self.signed else z3.ULE(a, b)
        return same if poison is None else z3.Or(poison, same)


def orders(rows: list[dict[Part, int]], sizes: Mapping[Part, int]) -> Iterator[Order]:
    """Which values were always the same, as branches on the way are, and which were never above others."""
    moving = [part for part in rows[0] if len({row[part] for row in rows}) > 1]
    for part, number in rows[0].items():
        if part not in moving:
            yield from (Order(part, number), Order(number, part))
    whole = [part for part in rows[0] if sizes[part] == WORD]
    others: list[Part | int] = [0, *whole]
    for a in (part for part in moving if part in whole):
        for b in others:
            for low, high in ((a, b), (b, a)):
                for signed in (True, False):
                    flip = 0x8000 if signed else 0
                    pairs = [(_number(low, row) ^ flip, _number(high, row) ^ flip) for row in rows]
                    if a != b and (low != 0 or signed) and all(x <= y for x, y in pairs):
                        yield Order(low, high, signed)


def _number(one: Part | int, row: dict[Part, int]) -> int:
    return one if isinstance(one, int) else row[one]


def parts_of(key: Any, value: tuple[Term, Term | None]) -> Iterator[tuple[Part, int]]:
    """The words of a value, and how many bits of each are its own."""
    whole, rest = divmod(value[0].size(), WORD)
    yield from ((Part(key, n), WORD) for n in range(whole))
    if rest:
        yield from ((Part(key, whole, signed), rest) for signed in (False, True))


def guessed(place: int, held: list[int], rows: list[dict[Part, int]], sizes: Mapping[Part, int]) -> Iterator[Claim]:
    """Claims about one place. `rows` are the parts' numbers each time, `sizes` how many bits of a part are its own."""
    exact = False
    for part in rows[0]:
        if all(row[part] == number for row, number in zip(rows, held, strict=True)):
            exact = True
            yield Claim(place, ((1, part),))
        elif not part.signed and sizes[part] < WORD:
            mask = (1 << sizes[part]) - 1
            if all((row[part] ^ number) & mask == 0 for row, number in zip(rows, held, strict=True)):
                yield Claim(place, ((1, part),), 0, sizes[part])
    if len(set(held)) == 1:
        yield Claim(place, (), held[0])
    elif not exact and len(rows) >= FEWEST:
        yield from _sums(place, held, rows)


def _sums(place: int, held: list[int], rows: list[dict[Part, int]]) -> Iterator[Claim]:
    """A value and a number; or two and a number, of which one is multiplied."""
    moving = [part for part in rows[0] if len({row[part] for row in rows}) > 1]
    for a in moving:
        number = _rest(held, [row[a] for row in rows])
        if number is not None:
            yield Claim(place, ((1, a),), number)
    for n, a in enumerate(moving):
        for k, b in enumerate(moving):
            for factor in FACTORS:
                if n < k or (n > k and factor != 1):
                    number = _rest(held, [row[a] + factor * row[b] for row in rows])
                    if number is not None:
                        yield Claim(place, ((1, a), (factor, b)), number)
    for a in moving:
        for factor in FACTORS[1:]:
            number = _rest(held, [factor * row[a] for row in rows])
            if number is not None:
                yield Claim(place, ((factor, a),), number)


def _rest(held: list[int], sums: list[int]) -> int | None:
    """What is missing everywhere, if that is one number."""
    rests = {(number - total) & 0xFFFF for number, total in zip(held, sums, strict=True)}
    return rests.pop() if len(rests) == 1 else None
