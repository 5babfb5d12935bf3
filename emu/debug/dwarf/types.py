"""C types as DWARF tells them, and numbers out of bytes and back.

What enters: bytes in memory order, little endian. What leaves: ints, floats, dicts for structs and unions, lists for
arrays, text for people.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

LONGEST_TEXT: Final = 16
"""Elements of an array shown in one line."""
FLOATS: Final = {4: "<f", 8: "<d"}
QUALIFIERS: Final = ("typedef", "const", "volatile")
TAGGED: Final = ("struct", "union", "enum")
"""Kinds of types whose names are tags."""


@dataclass(frozen=True, slots=True)
class Member:
    """One member of a struct or union: byte `offset`; of a bit field also the bits above `lsb` of `type`'s bytes."""

    name: str
    type: Type
    offset: int
    bits: int = 0
    lsb: int = 0


@dataclass(eq=False, slots=True)
class Type:
    """One type. Types that refer to themselves are filled in after they are made, so the fields can change."""

    kind: str
    """"signed", "unsigned", "char" (signed or not), "bool", "float", "pointer", "array", "struct", "union", "enum",
    "function", "void", or one of QUALIFIERS."""
    name: str = ""
    size: int = 0
    """Bytes; 0 for void, functions and types that are only declared."""
    target: Type | None = None
    """What a pointer points to, an array consists of, a function returns, a qualifier qualifies."""
    count: int = 0
    """Elements of an array."""
    members: tuple[Member, ...] = ()
    names: dict[int, str] = field(default_factory=dict)
    """Enumerators by value."""
    is_signed: bool = False

    @property
    def bare(self) -> Type:
        """Without typedefs and qualifiers."""
        found = self
        while found.kind in QUALIFIERS and found.target is not None:
            found = found.target
        return found

    @property
    def bytes(self) -> int:
        """Size in bytes, through qualifiers."""
        bare = self.bare
        if bare.kind == "array" and bare.target is not None:
            return bare.count * bare.target.bytes
        return bare.size

    @property
    def is_number(self) -> bool:
        """Whether a value of it is one int or float."""
        return self.bare.kind in ("signed", "unsigned", "char", "bool", "float", "enum", "pointer")

    def member(self, name: str) -> Member | None:
        """The member called `name` of a struct or union; those of unnamed members count as its own."""
        for one in self.bare.members:
            if one.name == name:
                return one
            if not one.name:
                inner = one.type.member(name)
                if inner is not None:
                    return Member(name, inner.type, one.offset + inner.offset, inner.bits, inner.lsb)
        return None

    def __str__(self) -> str:
        """As C writes it, nearly: `unsigned int`, `struct point *`, `char[8]`."""
        match self.kind:
            case "pointer":
                target = str(self.target) if self.target is not None else "void"
                return f"{target} *" if not target.endswith("*") else f"{target}*"
            case "array":
                return f"{self.target}[{self.count}]"
            case "const" | "volatile":
                return f"{self.kind} {self.target or 'void'}"
            case "function":
                return f"{self.target or 'void'}()"
            case kind if kind in TAGGED:
                return f"{self.kind} {self.name or '<unnamed>'}"
        return self.name or self.kind


VOID: Final = Type("void", "void")
UNSIGNED: Final = {size: Type("unsigned", f"uint{8 * size}", size) for size in (1, 2, 4, 8)}
"""What a symbol without type is shown as, by size."""


def decode(kind: Type, data: bytes) -> Any:
    """The value in `data`, which has at least as many bytes as the type."""
    bare = kind.bare
    match bare.kind:
        case "float" if bare.size in FLOATS:
            return struct.unpack_from(FLOATS[bare.size], data)[0]
        case "array" if bare.target is not None:
            step = bare.target.bytes
            return [decode(bare.target, data[step * index :]) for index in range(bare.count)]
        case "struct" | "union":
            return {one.name: decode_member(one, data) for one in bare.members}
        case "bool":
            return bool(int.from_bytes(data[: bare.size], "little"))
    return int.from_bytes(data[: bare.size], "little", signed=bare.is_signed)


def decode_member(one: Member, data: bytes) -> Any:
    """The value of a member in the bytes of its struct."""
    inside = data[one.offset :]
    if not one.bits:
        return decode(one.type, inside)
    word = int.from_bytes(inside[: one.type.bytes], "little") >> one.lsb & (1 << one.bits) - 1
    if one.type.bare.is_signed and word >> one.bits - 1:
        word -= 1 << one.bits
    return word


def encode(kind: Type, value: Any) -> bytes:
    """`value` as bytes of that type. Raises ValueError for a value it cannot hold, TypeError for aggregates."""
    bare = kind.bare
    if bare.kind == "float" and bare.size in FLOATS:
        return struct.pack(FLOATS[bare.size], value)
    if not kind.is_number:
        raise TypeError(f"only numbers can be set, not a whole {kind}")
    number = int(value)
    bits = 8 * bare.size
    if not -(1 << bits - 1) <= number < 1 << bits:
        raise ValueError(f"{number} does not fit into {bits} bits of {kind}")
    return (number & (1 << bits) - 1).to_bytes(bare.size, "little")


def text_of(kind: Type, value: Any) -> str:
    """A value for people, in one line."""
    bare = kind.bare
    match bare.kind:
        case "pointer":
            return f"{value:#06x}"
        case "char":
            code = value & 0xFF
            return f"{value} {chr(code)!r}" if 0x20 <= code < 0x7F else str(value)
        case "enum":
            return bare.names.get(value, str(value))
        case "bool":
            return "true" if value else "false"
        case "float":
            return f"{value:.9g}" if bare.size == 4 else repr(value)
        case "array" if bare.target is not None:
            return _array(bare.target, value)
        case "struct" | "union":
            parts = (f"{one.name} = {text_of(one.type, value[one.name])}" for one in bare.members if one.name)
            return "{" + ", ".join(parts) + "}"
    return str(value)


def _array(target: Type, values: list[Any]) -> str:
    if target.bare.kind == "char":
        octets = bytes(value & 0xFF for value in values)
        return repr(octets.rstrip(b"\0").decode("latin-1"))
    shown = ", ".join(text_of(target, value) for value in values[:LONGEST_TEXT])
    return "{" + shown + (", ..." if len(values) > LONGEST_TEXT else "") + "}"


def parts_of(kind: Type) -> Iterator[Member]:
    """Members of a struct or union, elements of an array as members called `[0]`, `[1]`, ...; else nothing."""
    bare = kind.bare
    if bare.kind == "array" and bare.target is not None:
        step = bare.target.bytes
        for index in range(bare.count):
            yield Member(f"[{index}]", bare.target, step * index)
    yield from bare.members
