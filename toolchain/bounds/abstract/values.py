"""Sets of integers an instruction may see: an int when there is one member, otherwise a `Span`.

A span is an interval and the bits all its members agree on, both in two's complement of unlimited width, as the rows of
the instruction table compute (emu.dspic30f.isa.builder).  Every operation returns a superset of what it can yield.
"""

from __future__ import annotations

from typing import Any

Value = Any  # int | Span


class Span:
    """The integers in lo..hi whose bits under `mask` are `bits`; `ram`: an address in RAM, or never used as one."""

    __slots__ = ("bits", "hi", "lo", "mask", "ram")

    def __init__(self, lo: int, hi: int, mask: int, bits: int, ram: bool = False) -> None:
        self.lo, self.hi, self.mask, self.bits, self.ram = lo, hi, mask, bits, ram

    def __repr__(self) -> str:
        return f"{self.lo}..{self.hi}"

    def key(self) -> tuple[int, int, int, int, bool]:
        """What makes two spans equal; == is taken by the rows."""
        return self.lo, self.hi, self.mask, self.bits, self.ram

    __hash__ = None  # type: ignore[assignment]

    def __add__(self, other: Value) -> Value:
        lo, hi = ends(other)
        return span(self.lo + lo, self.hi + hi, ram=self._moved(other))

    __radd__ = __add__

    def __sub__(self, other: Value) -> Value:
        lo, hi = ends(other)
        return span(self.lo - hi, self.hi - lo, ram=self._moved(other))

    def _moved(self, by: Value) -> bool:
        """Whether it still leads to RAM. A constant that, in 16 bits, is an address of the window may be one, and this
        the index; and a number below 0 is one such."""
        return self.ram and isinstance(by, int) and 0 <= by < WINDOW

    def __rsub__(self, other: Value) -> Value:
        lo, hi = ends(other)
        return span(lo - self.hi, hi - self.lo)

    def __mul__(self, other: Value) -> Value:
        lo, hi = ends(other)
        corners = (self.lo * lo, self.lo * hi, self.hi * lo, self.hi * hi)
        return span(min(corners), max(corners))

    __rmul__ = __mul__

    def __and__(self, other: Value) -> Value:
        if isinstance(other, int) and other >= 0 and not other & (other + 1):  # the low bits
            if self.lo >= 0 and self.hi <= other:
                return self
            width = other.bit_length()
            if self.lo >> width == self.hi >> width:
                return span(self.lo & other, self.hi & other, self.mask & other, self.bits & other, self.ram)
        if self.ram and isinstance(other, int) and other == WORD.hi:  # an address that was moved, in a register
            return LINK
        if isinstance(other, int) and other > 0:
            below = (other & -other) - 1  # bits cleared at the low end: order stays
            top = other | below
            if not top & (top + 1) and self.lo >= 0 and self.hi <= top:
                return span(self.lo & other, self.hi & other, self.mask | below, self.bits & other)
        mask, bits = known(other)
        both = self.mask & mask | self.mask & ~self.bits | mask & ~bits
        result = of_bits(both, self.bits & bits & both)
        tops = [hi for lo, hi in (ends(self), ends(other)) if lo >= 0]
        return limited(result, 0, min(tops)) if tops else result

    __rand__ = __and__

    def __or__(self, other: Value) -> Value:
        mask, bits = known(other)
        both = self.mask & mask | self.mask & self.bits | mask & bits
        result = of_bits(both, (self.bits | bits) & both)
        lo = ends(other)[0]
        return limited(result, max(self.lo, lo), None) if self.lo >= 0 and lo >= 0 else result

    __ror__ = __or__

    def __xor__(self, other: Value) -> Value:
        if isinstance(other, int) and other >= 0 and not other & (other + 1) and self.lo >= 0 and self.hi <= other:
            return span(other - self.hi, other - self.lo, self.mask, (self.bits ^ other) & self.mask)
        if isinstance(other, int) and other > 0 and not other & (other - 1) and self.mask & other:  # a bit all agree on
            by = -other if self.bits & other else other
            return span(self.lo + by, self.hi + by, self.mask, self.bits ^ other)
        mask, bits = known(other)
        both = self.mask & mask
        return of_bits(both, (self.bits ^ bits) & both)

    __rxor__ = __xor__

    def __lshift__(self, count: Value) -> Value:
        lo, hi = ends(count)
        if lo == hi:
            return span(self.lo << lo, self.hi << lo, self.mask << lo | (1 << lo) - 1, self.bits << lo)
        corners = [v << n for v in (self.lo, self.hi) for n in (lo, hi)]
        return span(min(corners), max(corners))

    def __rlshift__(self, value: Value) -> Value:
        return span(*ends(value)) << self if isinstance(value, Span) else shifted(value, self, 1)

    def __rshift__(self, count: Value) -> Value:
        lo, hi = ends(count)
        if lo == hi:
            return span(self.lo >> lo, self.hi >> lo, self.mask >> lo, self.bits >> lo)
        corners = [v >> n for v in (self.lo, self.hi) for n in (lo, hi)]
        return span(min(corners), max(corners))

    def __rrshift__(self, value: Value) -> Value:
        return shifted(value, self, -1)

    def __invert__(self) -> Value:
        return span(~self.hi, ~self.lo, self.mask, ~self.bits & self.mask)

    def __neg__(self) -> Value:
        return span(-self.hi, -self.lo)

    def __eq__(self, other: object) -> Value:
        lo, hi = ends(other)
        mask, bits = known(other)
        return 0 if self.hi < lo or hi < self.lo or (self.bits ^ bits) & self.mask & mask else EITHER

    def __ne__(self, other: object) -> Value:
        same = self == other
        return 1 if isinstance(same, int) else EITHER

    def __lt__(self, other: Value) -> Value:
        lo, hi = ends(other)
        return 1 if self.hi < lo else 0 if self.lo >= hi else EITHER

    def __le__(self, other: Value) -> Value:
        lo, hi = ends(other)
        return 1 if self.hi <= lo else 0 if self.lo > hi else EITHER

    def __gt__(self, other: Value) -> Value:
        lo, hi = ends(other)
        return 1 if self.lo > hi else 0 if self.hi <= lo else EITHER

    def __ge__(self, other: Value) -> Value:
        lo, hi = ends(other)
        return 1 if self.lo >= hi else 0 if self.hi < lo else EITHER


def ends(value: Value) -> tuple[int, int]:
    """Least and greatest member."""
    return (value.lo, value.hi) if isinstance(value, Span) else (int(value), int(value))


def known(value: Value) -> tuple[int, int]:
    """The bits all members agree on: under which mask, and which."""
    return (value.mask, value.bits) if isinstance(value, Span) else (-1, int(value))


def span(lo: int, hi: int, mask: int = 0, bits: int = 0, ram: bool = False) -> Value:
    """The set lo..hi with the known bits given and those that follow from the interval."""
    if lo == hi:
        return lo
    if (lo < 0) == (hi < 0):
        high = -1 << (lo ^ hi).bit_length()
        mask, bits = mask | high, bits & ~high | lo & high
    return Span(lo, hi, mask, bits, ram)


def of_bits(mask: int, bits: int) -> Value:
    """Every integer with these bits; beyond 2**40 nothing of the table computes."""
    if mask == -1:
        return bits
    if mask >= 0:
        return Span(-1 << 62, 1 << 62, mask, bits)
    return Span(bits, bits | ~mask, mask, bits)


def limited(value: Value, lo: int, hi: int | None) -> Value:
    """The members of value within lo..hi; the caller knows there are some."""
    if isinstance(value, int):
        return value
    return span(max(value.lo, lo), value.hi if hi is None else min(value.hi, hi), value.mask, value.bits)


def shifted(value: int, count: Span, sign: int) -> Value:
    """A constant shifted left (sign 1) or right (-1) by a count that is not known."""
    a, b = (value << count.lo, value << count.hi) if sign > 0 else (value >> count.lo, value >> count.hi)
    return span(min(a, b), max(a, b))


def union(a: Value, b: Value) -> Value:
    """The smallest set known here that holds both."""
    if a is b or (isinstance(a, int) and isinstance(b, int) and a == b):
        return a
    (la, ha), (lb, hb), (ma, ba), (mb, bb) = ends(a), ends(b), known(a), known(b)
    mask = ma & mb & ~(ba ^ bb)
    return span(min(la, lb), max(ha, hb), mask, ba & mask, is_ram(a) and is_ram(b))


def is_ram(value: Value) -> bool:
    """Whether reading there does not read the window."""
    lo, hi = ends(value)
    return (lo >= 0 and hi < WINDOW) or (isinstance(value, Span) and value.ram)


def key_of(value: Value) -> Any:
    """Something hashable, equal for equal sets."""
    return value.key() if isinstance(value, Span) else int(value)


WINDOW = 0x8000
"""Data addresses from here on are the PSV window (isa.md §1.2)."""
EITHER = Span(0, 1, -2, 0)
BYTE = span(0, 0xFF)
WORD = span(0, 0xFFFF)
LINK = span(0, 0xFFFF, ram=True)
PROGRAM = span(0, 0xFFFFFF)
ACCUMULATOR = span(-1 << 39, (1 << 39) - 1)
