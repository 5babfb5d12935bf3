"""Sets of integers: an int for a set of one member, otherwise an `Interval` with known bits.

Interval and known bits are in two's complement of unlimited width, as the instruction table computes
(emu.dspic30f.isa.builder).  Every operation over-approximates: its result contains all possible results.
"""

from __future__ import annotations

from typing import Any

Value = Any  # int | Interval


class Interval:
    """The integers in lo..hi whose bits under `mask` are `bits`.

    ram    whether members used as addresses are in RAM
    least  if above 0: every member is 0 or at least this, as the pointers of a function that may return NULL
    """

    __slots__ = ("bits", "hi", "least", "lo", "mask", "ram")

    def __init__(self, lo: int, hi: int, mask: int, bits: int, ram: bool = False, least: int = 0) -> None:
        self.lo, self.hi, self.mask, self.bits, self.ram, self.least = lo, hi, mask, bits, ram, least

    def __repr__(self) -> str:
        return f"{self.lo}..{self.hi}"

    def key(self) -> tuple[int, int, int, int, bool, int]:
        """Return a key for equality of sets; `==` builds the comparison of the instruction table instead."""
        return self.lo, self.hi, self.mask, self.bits, self.ram, self.least

    __hash__ = None  # type: ignore[assignment]

    def __add__(self, other: Value) -> Value:
        lo, hi = extremes(other)
        return interval(self.lo + lo, self.hi + hi, ram=self._stays_in_ram(other))

    __radd__ = __add__

    def __sub__(self, other: Value) -> Value:
        lo, hi = extremes(other)
        return interval(self.lo - hi, self.hi - lo, ram=self._stays_in_ram(other))

    def _stays_in_ram(self, by: Value) -> bool:
        """Whether all members of the set plus `by` are RAM addresses.

        A constant that is a PSV window address in 16 bits, as every negative number is, may be the base address and
        the set the index.
        """
        return self.ram and isinstance(by, int) and 0 <= by < WINDOW

    def __rsub__(self, other: Value) -> Value:
        lo, hi = extremes(other)
        return interval(lo - self.hi, hi - self.lo)

    def __mul__(self, other: Value) -> Value:
        lo, hi = extremes(other)
        corners = (self.lo * lo, self.lo * hi, self.hi * lo, self.hi * hi)
        return interval(min(corners), max(corners))

    __rmul__ = __mul__

    def __and__(self, other: Value) -> Value:
        if isinstance(other, int) and other >= 0 and not other & (other + 1):  # `other` is a mask of the low bits
            if self.lo >= 0 and self.hi <= other:
                return self
            width = other.bit_length()
            if self.lo >> width == self.hi >> width:
                return interval(self.lo & other, self.hi & other, self.mask & other, self.bits & other, self.ram)
        if self.ram and isinstance(other, int) and other == WORD.hi:  # RAM address plus offset, truncated to 16 bits
            return RAM_POINTER
        if isinstance(other, int) and other > 0:
            below = (other & -other) - 1  # clearing low bits preserves the order
            top = other | below
            if not top & (top + 1) and self.lo >= 0 and self.hi <= top:
                return interval(self.lo & other, self.hi & other, self.mask | below, self.bits & other)
        mask, bits = known_bits(other)
        both = self.mask & mask | self.mask & ~self.bits | mask & ~bits
        result = from_known_bits(both, self.bits & bits & both)
        tops = [hi for lo, hi in (extremes(self), extremes(other)) if lo >= 0]
        return clamped(result, 0, min(tops)) if tops else result

    __rand__ = __and__

    def __or__(self, other: Value) -> Value:
        mask, bits = known_bits(other)
        both = self.mask & mask | self.mask & self.bits | mask & bits
        result = from_known_bits(both, (self.bits | bits) & both)
        lo = extremes(other)[0]
        return clamped(result, max(self.lo, lo), None) if self.lo >= 0 and lo >= 0 else result

    __ror__ = __or__

    def __xor__(self, other: Value) -> Value:
        if isinstance(other, int) and other >= 0 and not other & (other + 1) and self.lo >= 0 and self.hi <= other:
            return interval(other - self.hi, other - self.lo, self.mask, (self.bits ^ other) & self.mask)
        if isinstance(other, int) and other > 0 and not other & (other - 1) and self.mask & other:  # one known bit
            by = -other if self.bits & other else other
            return interval(self.lo + by, self.hi + by, self.mask, self.bits ^ other)
        mask, bits = known_bits(other)
        both = self.mask & mask
        return from_known_bits(both, (self.bits ^ bits) & both)

    __rxor__ = __xor__

    def __lshift__(self, count: Value) -> Value:
        lo, hi = _shift_counts(count)
        if lo == hi:
            return interval(self.lo << lo, self.hi << lo, self.mask << lo | (1 << lo) - 1, self.bits << lo)
        corners = [v << n for v in (self.lo, self.hi) for n in (lo, hi)]
        return interval(min(corners), max(corners))

    def __rlshift__(self, value: Value) -> Value:
        return interval(*extremes(value)) << self if isinstance(value, Interval) else shift_constant(value, self, 1)

    def __rshift__(self, count: Value) -> Value:
        lo, hi = _shift_counts(count)
        if lo == hi:
            return interval(self.lo >> lo, self.hi >> lo, self.mask >> lo, self.bits >> lo)
        corners = [v >> n for v in (self.lo, self.hi) for n in (lo, hi)]
        return interval(min(corners), max(corners))

    def __rrshift__(self, value: Value) -> Value:
        return shift_constant(value, self, -1)

    def __invert__(self) -> Value:
        return interval(~self.hi, ~self.lo, self.mask, ~self.bits & self.mask)

    def __neg__(self) -> Value:
        return interval(-self.hi, -self.lo)

    def __eq__(self, other: object) -> Value:
        lo, hi = extremes(other)
        mask, bits = known_bits(other)
        return 0 if self.hi < lo or hi < self.lo or (self.bits ^ bits) & self.mask & mask else BIT

    def __ne__(self, other: object) -> Value:
        same = self == other
        return 1 if isinstance(same, int) else BIT

    def __lt__(self, other: Value) -> Value:
        lo, hi = extremes(other)
        return 1 if self.hi < lo else 0 if self.lo >= hi else BIT

    def __le__(self, other: Value) -> Value:
        lo, hi = extremes(other)
        return 1 if self.hi <= lo else 0 if self.lo > hi else BIT

    def __gt__(self, other: Value) -> Value:
        lo, hi = extremes(other)
        return 1 if self.lo > hi else 0 if self.hi <= lo else BIT

    def __ge__(self, other: Value) -> Value:
        lo, hi = extremes(other)
        return 1 if self.lo >= hi else 0 if self.hi < lo else BIT


def extremes(value: Value) -> tuple[int, int]:
    """Return the least and the greatest member."""
    return (value.lo, value.hi) if isinstance(value, Interval) else (int(value), int(value))


def known_bits(value: Value) -> tuple[int, int]:
    """Return the mask of bits that are equal in all members, and their values."""
    return (value.mask, value.bits) if isinstance(value, Interval) else (-1, int(value))


def interval(lo: int, hi: int, mask: int = 0, bits: int = 0, ram: bool = False) -> Value:
    """Return the set lo..hi with the given known bits and those that follow from the interval."""
    if lo == hi:
        return lo
    if (lo < 0) == (hi < 0):
        high = -1 << (lo ^ hi).bit_length()
        mask, bits = mask | high, bits & ~high | lo & high
    return Interval(lo, hi, mask, bits, ram)


def from_known_bits(mask: int, bits: int) -> Value:
    """Return the set of all integers with these known bits; instructions compute with less than 2**40."""
    if mask == -1:
        return bits
    if mask >= 0:
        return Interval(-1 << 62, 1 << 62, mask, bits)
    return Interval(bits, bits | ~mask, mask, bits)


def clamped(value: Value, lo: int, hi: int | None) -> Value:
    """Return the members of `value` within lo..hi; the caller ensures that there are some."""
    if isinstance(value, int):
        return value
    return interval(max(value.lo, lo), value.hi if hi is None else min(value.hi, hi), value.mask, value.bits)


def _shift_counts(count: Value) -> tuple[int, int]:
    """Return the least and the greatest shift count of a set.

    Instructions shift by 0 or more. A set may hold smaller numbers, because it is an over-approximation."""
    lo, hi = extremes(count)
    return max(lo, 0), max(hi, 0)


def shift_constant(value: int, count: Interval, sign: int) -> Value:
    """Return a constant shifted left (sign 1) or right (-1) by an unknown count."""
    lo, hi = _shift_counts(count)
    a, b = (value << lo, value << hi) if sign > 0 else (value >> lo, value >> hi)
    return interval(min(a, b), max(a, b))


def union(a: Value, b: Value) -> Value:
    """Return the smallest representable set that contains both."""
    if a is b or (isinstance(a, int) and isinstance(b, int) and a == b):
        return a
    (la, ha), (lb, hb), (ma, ba), (mb, bb) = extremes(a), extremes(b), known_bits(a), known_bits(b)
    mask = ma & mb & ~(ba ^ bb)
    result = interval(min(la, lb), max(ha, hb), mask, ba & mask, is_ram_address(a) and is_ram_address(b))
    if isinstance(result, Interval) and result.lo == 0:
        result.least = min(_least_but_zero(a), _least_but_zero(b))
    return result


def _least_but_zero(value: Value) -> int:
    """Return a lower bound of the members except 0, of a set without negative numbers; 0 if only that is known."""
    lo, hi = extremes(value)
    if lo > 0 or hi == 0:
        return lo or _NO_MEMBER
    return value.least if isinstance(value, Interval) else 0


def is_ram_address(value: Value) -> bool:
    """Whether a read at this address never reads the PSV window."""
    lo, hi = extremes(value)
    return (lo >= 0 and hi < WINDOW) or (isinstance(value, Interval) and value.ram)


def key_of(value: Value) -> Any:
    """Return a hashable key that is equal for equal sets."""
    return value.key() if isinstance(value, Interval) else int(value)


_NO_MEMBER = 1 << 62
WINDOW = 0x8000
"""First data address of the PSV window (isa.md §1.2)."""
BIT = Interval(0, 1, -2, 0)
BYTE = interval(0, 0xFF)
WORD = interval(0, 0xFFFF)
RAM_POINTER = interval(0, 0xFFFF, ram=True)
PROGRAM_WORD = interval(0, 0xFFFFFF)
ACCUMULATOR = interval(-1 << 39, (1 << 39) - 1)
