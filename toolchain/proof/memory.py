"""Memory model: shared bytes of source and machine, and the machine's private stack frame.

W15 at entry is a number (`STACK`), so frame addresses are numbers.  The stack from the return address up is private:
pointers reach only the variables that the source has there (`StackFrame.objects`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import z3

from toolchain.abi.target import RAM_END, RETURN_ADDRESS_BYTES
from toolchain.proof.terms import Term, constant_value, vector

STACK = 0x1A00
"""W15 at a function's first instruction, above the return address."""
BYTE = 8


@dataclass
class StackFrame:
    """The private part of the stack.

    lowest   its lowest address
    objects  address and size of each source variable in it
    escaped  variables whose addresses escape
    """

    lowest: int = STACK - RETURN_ADDRESS_BYTES
    objects: dict[str, tuple[int, int]] = field(default_factory=dict)
    escaped: set[str] = field(default_factory=set)

    def is_private(self, address: int) -> bool:
        """Whether a byte is private to the machine."""
        return self.lowest <= address < RAM_END and not self.is_object(address)

    def is_object(self, address: int) -> bool:
        """Whether a byte belongs to a source variable."""
        return any(start <= address < start + size for start, size in self.objects.values())

    def unescaped_bytes(self) -> list[int]:
        """Return the byte addresses of variables whose addresses do not escape."""
        places = [place for name, place in self.objects.items() if name not in self.escaped]
        return [start + k for start, size in places for k in range(size)]

    def avoids_private_bytes(self, address: Term, size: int) -> Term:
        """Return the condition that `size` bytes at a 16-bit address overlap no private byte."""
        last = address + (size - 1)
        below = z3.And(z3.ULT(address, self.lowest), z3.ULT(last, self.lowest))
        above = z3.And(z3.UGE(address, RAM_END), z3.UGE(last, RAM_END))
        inside = [
            z3.And(z3.UGE(address, start), z3.ULE(address, start + length - size))
            for start, length in self.objects.values()
            if length >= size
        ]
        return z3.Or(below, above, *inside)


class SymbolicMemory:
    """Bytes by address: a z3 array, overlaid with the bytes written at known addresses."""

    def __init__(self, array: Term, written: dict[int, Term] | None = None) -> None:
        self.array = array
        self.written = written if written is not None else {}

    def copy(self) -> SymbolicMemory:
        """Return an independent copy."""
        return SymbolicMemory(self.array, dict(self.written))

    def whole(self) -> Term:
        """Return the whole memory as one array."""
        for address, byte in self.written.items():
            self.array = z3.Store(self.array, vector(address, 16), byte)
        self.written.clear()
        return self.array

    def byte(self, address: int) -> Term:
        """Return the byte at a known address."""
        found = self.written.get(address)
        if found is None:
            found = z3.Select(self.array, vector(address, 16))
        return found

    def read(self, address: Term | int, size: int) -> Term:
        """Return `size` bytes, the lowest first, as one vector."""
        place = address if isinstance(address, int) else constant_value(address)
        if place is not None:
            parts = [self.byte((place + k) & 0xFFFF) for k in range(size)]
        else:
            array = self.whole()
            parts = [z3.Select(array, address + k) for k in range(size)]
        return concat(parts)

    def write(self, address: Term | int, value: Term) -> None:
        """Write the bytes of a vector, the lowest first."""
        place = address if isinstance(address, int) else constant_value(address)
        for k, part in enumerate(bytes_of(value)):
            if place is not None:
                self.written[(place + k) & 0xFFFF] = part
            else:
                self.array = z3.Store(self.whole(), address + k, part)

    def havoc(self, array: Term, kept: list[int]) -> None:
        """Replace the contents by an unknown array, except for the bytes at the addresses `kept`."""
        same = {address: self.byte(address) for address in kept}
        self.array, self.written = array, same


def concat(parts: list[Term]) -> Term:
    """Concatenate bytes, the lowest first; for all bytes of one vector, return that vector itself."""
    if len(parts) == 1:
        return parts[0]
    return z3.simplify(z3.Concat(*reversed(parts)))


def bytes_of(value: Term) -> list[Term]:
    """Return the bytes of a vector, the lowest first; the last is zero-extended."""
    missing = -value.size() % BYTE
    if missing:
        value = z3.ZeroExt(missing, value)
    if value.size() == BYTE:
        return [value]
    return [z3.simplify(z3.Extract(k + BYTE - 1, k, value)) for k in range(0, value.size(), BYTE)]
