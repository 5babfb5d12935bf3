"""Typed objects of the program: variables, their members and elements, read and assigned through a view."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, Protocol

from emu.debug.dwarf import location
from emu.debug.dwarf.types import Member, Type, decode, decode_member, encode, parts_of, text_of
from emu.debug.frame import Frame, FrameView


class ViewSource(Protocol):
    """Source of views of frames: the `Inspector` of a machine."""

    def view(self, frame: Frame | None = None) -> FrameView:
        """Return the registers and memory as visible from `frame`."""


class Value:
    """A typed object located in memory, in registers, or in debug information as a constant."""

    def __init__(
        self,
        kind: Type,
        pieces: tuple[location.Piece, ...],
        view: location.View,
        name: str = "",
        bits: tuple[int, int] | None = None,
    ) -> None:
        self.type: Final = kind
        self.pieces: Final = pieces
        self.name: Final = name
        self._view: Final = view
        self.bits: Final = bits
        """Width and least significant bit of a bit field; None for other objects."""

    @property
    def address(self) -> int | None:
        """Data address of the object, None if it does not lie entirely in memory."""
        return location.address_of(self.pieces)

    @property
    def data(self) -> bytes:
        """Bytes of the object. Raises Unavailable."""
        return location.read(self.pieces, max(self.type.bytes, 1), self._view)

    def get(self) -> Any:
        """Return the value as a Python object: int, float, bool, dict of members, list of elements.

        Raises Unavailable.
        """
        if self.bits is not None:
            return decode_member(Member("", self.type, 0, *self.bits), self.data)
        return decode(self.type, self.data)

    def set(self, value: Any) -> None:
        """Assign a number. Raises Unavailable, ValueError for a number that does not fit, TypeError for aggregates."""
        if self.bits is not None:
            count, lsb = self.bits
            number, mask = int(value), (1 << count) - 1 << lsb
            if not -(1 << count - 1) <= number < 1 << count:
                raise ValueError(f"{number} does not fit into the {count} bits of {self.name}")
            word = int.from_bytes(self.data, "little") & ~mask | number << lsb & mask
            location.write(self.pieces, word.to_bytes(self.type.bytes, "little"), self._view)
            return
        location.write(self.pieces, encode(self.type, value), self._view)

    @property
    def frame(self) -> Frame | None:
        """The frame in which the object was looked up, None for the machine itself."""
        return self._view.frame if isinstance(self._view, FrameView) else None

    def rebind(self, inspector: ViewSource) -> Value:
        """Return the same object in another machine that is in the same state."""
        return Value(self.type, self.pieces, inspector.view(self.frame), self.name, self.bits)

    def text(self) -> str:
        """Return the value as one line of text, or the reason why it is unavailable."""
        try:
            return text_of(self.type, self.get())
        except location.Unavailable as why:
            return f"<{why}>"

    def __getitem__(self, part: str | int) -> Value:
        """Return a member by name, an element by index, or a pointer's target (index 0). Raises KeyError, TypeError."""
        bare = self.type.bare
        if isinstance(part, str):
            member = self.type.member(part)
            if member is None:
                raise KeyError(f"{self.type} has no member {part!r}")
            bits = (member.bits, member.lsb) if member.bits else None
            return Value(member.type, self._slice(member.offset, member.type.bytes), self._view, part, bits)
        target = bare.target
        if bare.kind not in ("array", "pointer") or target is None:
            raise TypeError(f"{self.type} has no elements")
        if bare.kind == "pointer":
            place = location.Piece("memory", self.get() + part * max(target.bytes, 1) & 0xFFFF)
            return Value(target, (place,), self._view, f"{self.name}[{part}]")
        if not 0 <= part < bare.count:
            raise KeyError(f"{self.name or 'the array'} has elements 0 to {bare.count - 1}, not {part}")
        return Value(target, self._slice(part * target.bytes, target.bytes), self._view, f"{self.name}[{part}]")

    def parts(self) -> Iterator[Value]:
        """Yield the members of a struct, the elements of an array, or the target of a pointer."""
        bare = self.type.bare
        if bare.kind == "pointer" and bare.target is not None and bare.target.bare.kind not in ("void", "function"):
            yield self[0]
        for member in parts_of(self.type):
            bits = (member.bits, member.lsb) if member.bits else None
            yield Value(member.type, self._slice(member.offset, member.type.bytes), self._view, member.name, bits)

    def _slice(self, offset: int, size: int) -> tuple[location.Piece, ...]:
        """Return the pieces that contain `size` bytes from `offset`."""
        found = []
        begin = 0
        for piece in self.pieces:
            length = piece.size or self.type.bytes - begin
            first, last = max(offset, begin), min(offset + size, begin + length)
            if first < last:
                skip = first - begin
                if piece.kind == "register":
                    number, skip = divmod(skip + piece.skip, self._view.register_size(piece.at))
                    found.append(location.Piece("register", piece.at + number, last - first, skip=skip))
                elif piece.kind == "memory":
                    found.append(location.Piece("memory", piece.at + skip, last - first))
                else:
                    found.append(location.Piece(piece.kind, 0, last - first, piece.data[skip:]))
            begin += length
        if len(found) == 1 and found[0].kind == "memory":
            return (location.Piece("memory", found[0].at),)
        return tuple(found)
