"""The state record: one flat buffer that contains a machine's complete state.

Inputs: names, element kinds and counts, reserved once while a machine is built. Outputs: byte offsets for native code
and typed views for Python. Byte offset 0 is data address 0: working registers, SFRs and RAM are in the record at their
data addresses (isa.md §1.2). A snapshot is one copy; one comparison compares two machines.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Final

CAPACITY: Final = 0x80000
"""Size of a record in bytes, of which `Record.used` are reserved."""
HOSTS: Final = 0x1000
"""Number of bytes at the end of a record for host addresses."""

SIZES: Final = {"B": 1, "H": 2, "I": 4, "Q": 8, "q": 8}


@dataclass(frozen=True, slots=True)
class Field:
    """A named array in the record: byte `offset`, element `kind` (letter of the struct module) and `count`."""

    name: str
    offset: int
    kind: str
    count: int

    @property
    def index(self) -> int:
        """Return the index of the first element in the view for this kind."""
        return self.offset // SIZES[self.kind]


class Record:
    """Little-endian buffer with views of 8, 16, 32 and 64 bits and a directory of named fields."""

    def __init__(self, data_end: int) -> None:
        self.data_end: Final = data_end
        """End of SFRs and RAM in data addresses (isa.md §1.2)."""
        self._memory = (ctypes.c_uint8 * CAPACITY)()
        self.address: Final = ctypes.addressof(self._memory)
        self.bytes: Final = memoryview(self._memory).cast("B")
        self.u8: Final = self.bytes
        self.u16: Final = self.bytes.cast("H")
        self.u32: Final = self.bytes.cast("I")
        self.u64: Final = self.bytes.cast("Q")
        self.s64: Final = self.bytes.cast("q")
        self.fields: Final[dict[str, Field]] = {}
        self.used = data_end
        self._hosts = CAPACITY

    def reserve(self, name: str, kind: str, count: int = 1) -> Field:
        """Reserve `count` zeroed elements of `kind` ("B", "H", "I", "Q" unsigned, "q" signed) under `name`.

        Raises ValueError if the name is already reserved or the record is full.
        """
        if name in self.fields:
            raise ValueError(f"record field {name!r} is reserved already")
        size = SIZES[kind]
        offset = -(-self.used // size) * size
        if offset + size * count > CAPACITY - HOSTS:
            raise ValueError(f"record field {name!r} does not fit: {size * count} bytes at {offset:#x}")
        self.used = offset + size * count
        field = Field(name, offset, kind, count)
        self.fields[name] = field
        return field

    def reserve_array(self, name: str, kind: str, count: int) -> memoryview[int]:
        """Reserve elements as `reserve` does, and return a view of them."""
        field = self.reserve(name, kind, count)
        return self.view(kind)[field.index : field.index + count]

    def view(self, kind: str) -> memoryview[int]:
        """Return the view of the whole record for elements of `kind`. Raises KeyError for an unknown kind."""
        return {"B": self.u8, "H": self.u16, "I": self.u32, "Q": self.u64, "q": self.s64}[kind]

    def reserve_addresses(self, count: int) -> int:
        """Reserve `count` zeroed 64-bit words for host addresses. Return the byte offset of the first.

        They are not part of the state, so snapshots exclude them. Raises ValueError if the record is full."""
        if self._hosts - 8 * count < CAPACITY - HOSTS:
            raise ValueError(f"no room for {count} addresses")
        self._hosts -= 8 * count
        return self._hosts

    def snapshot(self) -> bytes:
        """Return a copy of the complete state."""
        return bytes(self.bytes[: self.used])

    def restore(self, state: bytes) -> None:
        """Restore a `snapshot` of an equally built machine. Raises ValueError for another size."""
        if len(state) != self.used:
            raise ValueError(f"snapshot has {len(state)} bytes, this machine's record {self.used}")
        self.bytes[: self.used] = state

    def field_at(self, offset: int) -> str:
        """Return the name of the field at a byte offset, for reports of differences between records."""
        if offset < self.data_end:
            return f"data {offset:#06x}"
        for field in self.fields.values():
            size = SIZES[field.kind]
            if field.offset <= offset < field.offset + size * field.count:
                return f"{field.name}[{(offset - field.offset) // size}]"
        return f"gap {offset:#x}"
