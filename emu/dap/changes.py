"""What a client changes in a machine that stands, as a record: it can be changed again in another that stands there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from emu.debug.dwarf.location import Piece
from emu.debug.dwarf.types import Type
from emu.debug.inspector import Frame, Inspector, Value


class Change(Protocol):
    """Holds plain values only, so it can be told to another process."""

    def do(self, inspector: Inspector) -> None:
        """Change it there. Raises locate.Unavailable, ValueError, TypeError."""


@dataclass(frozen=True, slots=True)
class Assigned:
    """A place of the program got a value."""

    type: Type
    pieces: tuple[Piece, ...]
    frame: Frame | None
    name: str
    bits: tuple[int, int] | None
    number: Any

    def do(self, inspector: Inspector) -> None:
        """As `Change.do`."""
        Value(self.type, self.pieces, inspector.view(self.frame), self.name, self.bits).set(self.number)


@dataclass(frozen=True, slots=True)
class Poked:
    """Bytes of data space were written."""

    address: int
    data: bytes

    def do(self, inspector: Inspector) -> None:
        """As `Change.do`."""
        inspector.machine.poke(self.address, int.from_bytes(self.data, "little"), len(self.data))


def assigned(place: Value, number: Any) -> Assigned:
    """`place` gets `number`, wherever the machine stands as it does here."""
    return Assigned(place.type, place.pieces, place.frame, place.name, place.bits, number)
