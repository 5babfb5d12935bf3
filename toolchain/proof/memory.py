"""Memory of both sides: bytes that everybody shares, and of the machine those of its own frame.

W15 at entry is a number (`STACK`), so places in a frame are numbers, too. What lies at or above the return address is
private: no pointer leads there but to the variables that the source has there (`Frame.objects`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import z3

from toolchain.abi.target import RAM_END, RETURN_ADDRESS_BYTES
from toolchain.proof.terms import Term, known, vector

STACK = 0x1A00
"""W15 behind the return address, at a function's first instruction."""
BYTE = 8


@dataclass
class Frame:
    """Where the private part of the stack begins, and what of it the source knows: address and bytes of each variable,
    `escaped` those whose addresses others may have."""

    lowest: int = STACK - RETURN_ADDRESS_BYTES
    objects: dict[str, tuple[int, int]] = field(default_factory=dict)
    escaped: set[str] = field(default_factory=set)

    def is_private(self, address: int) -> bool:
        """Whether only the machine knows the byte."""
        return self.lowest <= address < RAM_END and not self.is_object(address)

    def is_object(self, address: int) -> bool:
        """Whether the byte is of a variable of the source."""
        return any(start <= address < start + size for start, size in self.objects.values())

    def kept(self) -> list[int]:
        """Bytes of variables whose addresses nobody else has."""
        places = [place for name, place in self.objects.items() if name not in self.escaped]
        return [start + k for start, size in places for k in range(size)]

    def spared(self, address: Term, size: int) -> Term:
        """That `size` bytes at an address (16 bits) touch nothing private."""
        last = address + (size - 1)
        below = z3.And(z3.ULT(address, self.lowest), z3.ULT(last, self.lowest))
        above = z3.And(z3.UGE(address, RAM_END), z3.UGE(last, RAM_END))
        inside = [
            z3.And(z3.UGE(address, start), z3.ULE(address, start + length - size))
            for start, length in self.objects.values()
            if length >= size
        ]
        return z3.Or(below, above, *inside)


class Memory:
    """Bytes by address: a z3 array, and over it those that were written at addresses that are numbers."""

    def __init__(self, array: Term, written: dict[int, Term] | None = None) -> None:
        self.array = array
        self.written = written if written is not None else {}

    def copy(self) -> Memory:
        """An independent memory."""
        return Memory(self.array, dict(self.written))

    def whole(self) -> Term:
        """All of it as one array."""
        for address, byte in self.written.items():
            self.array = z3.Store(self.array, vector(address, 16), byte)
        self.written.clear()
        return self.array

    def byte(self, address: int) -> Term:
        """The byte at a known address."""
        found = self.written.get(address)
        if found is None:
            found = z3.Select(self.array, vector(address, 16))
        return found

    def read(self, address: Term | int, size: int) -> Term:
        """`size` bytes, the lowest first, as one vector."""
        place = address if isinstance(address, int) else known(address)
        if place is not None:
            parts = [self.byte((place + k) & 0xFFFF) for k in range(size)]
        else:
            array = self.whole()
            parts = [z3.Select(array, address + k) for k in range(size)]
        return joined(parts)

    def write(self, address: Term | int, value: Term) -> None:
        """The bytes of a vector, the lowest first."""
        place = address if isinstance(address, int) else known(address)
        for k, part in enumerate(split(value)):
            if place is not None:
                self.written[(place + k) & 0xFFFF] = part
            else:
                self.array = z3.Store(self.whole(), address + k, part)

    def become(self, array: Term, kept: list[int]) -> None:
        """Others have run: everything may have changed but the bytes at the addresses `kept`."""
        same = {address: self.byte(address) for address in kept}
        self.array, self.written = array, same


def joined(parts: list[Term]) -> Term:
    """Bytes, the lowest first, as one vector; parts of one vector become that vector again."""
    if len(parts) == 1:
        return parts[0]
    return z3.simplify(z3.Concat(*reversed(parts)))


def split(value: Term) -> list[Term]:
    """The bytes of a vector, the lowest first; the last is filled up with zeros."""
    missing = -value.size() % BYTE
    if missing:
        value = z3.ZeroExt(missing, value)
    if value.size() == BYTE:
        return [value]
    return [z3.simplify(z3.Extract(k + BYTE - 1, k, value)) for k in range(0, value.size(), BYTE)]
