"""Records of changes that a client makes to a paused machine.

A record can be applied again in another machine that is in the same state.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from emu.debug.dwarf.location import Piece
from emu.debug.dwarf.types import Type
from emu.debug.frame import Frame
from emu.debug.inspector import Inspector
from emu.debug.value import Value


class StateChange(Protocol):
    """A change described by plain values, so that it can be sent to another process."""

    def apply(self, inspector: Inspector) -> None:
        """Apply the change to the inspector's machine. Raises Unavailable, ValueError, TypeError."""


@dataclass(frozen=True, slots=True)
class Assignment:
    """Assignment of a value to an object of the program."""

    type: Type
    pieces: tuple[Piece, ...]
    frame: Frame | None
    name: str
    bits: tuple[int, int] | None
    number: Any

    def apply(self, inspector: Inspector) -> None:
        """Perform the assignment; see `StateChange.apply`."""
        Value(self.type, self.pieces, inspector.view(self.frame), self.name, self.bits).set(self.number)


@dataclass(frozen=True, slots=True)
class MemoryWrite:
    """Write of bytes to data memory."""

    address: int
    data: bytes

    def apply(self, inspector: Inspector) -> None:
        """Write the bytes; see `StateChange.apply`."""
        inspector.machine.poke(self.address, int.from_bytes(self.data, "little"), len(self.data))


def assignment(place: Value, number: Any) -> Assignment:
    """Return the assignment of `number` to `place`. It can be applied in every machine in the same state."""
    return Assignment(place.type, place.pieces, place.frame, place.name, place.bits, number)
