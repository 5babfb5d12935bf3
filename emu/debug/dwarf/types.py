"""C types read from DWARF, and conversion between bytes and Python values.

Bytes are in memory order, little-endian. Values are ints, floats, dicts for structs and unions, and lists for arrays.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

MAX_SHOWN_ELEMENTS: Final = 16
"""Maximum number of elements shown of each array."""
MAX_SHOWN_NUMBERS: Final = 64
"""Maximum number of numbers shown of an object, over all its members and elements."""
FLOATS: Final = {4: "<f", 8: "<d"}
QUALIFIERS: Final = ("typedef", "const", "volatile")
TAGGED: Final = ("struct", "union", "enum")
"""Kinds of types that have a tag name: structs, unions and enumerations."""


@dataclass(frozen=True, slots=True)
class Member:
    """Member of a struct or union at byte `offset`. A bit field has `bits` bits from `lsb` of the bytes of `type`."""

    name: str
    type: Type
    offset: int
    bits: int = 0
    lsb: int = 0


@dataclass(eq=False, slots=True)
class Type:
    """A C type. Fields are mutable, because a self-referential type is completed after its creation."""

    kind: str
    """Kind of type: "signed", "unsigned", "char" (signed or not), "bool", "float", "pointer", "array", "struct",
    "union", "enum", "function", "void", or one of QUALIFIERS."""
    name: str = ""
    size: int = 0
    """Size in bytes; 0 for void, functions and incomplete types."""
    target: Type | None = None
    """Target of a pointer, element of an array, result of a function, or type without the qualifier."""
    count: int = 0
    """Number of elements if the type is an array."""
    members: tuple[Member, ...] = ()
    names: dict[int, str] = field(default_factory=dict)
    """Names of enumerators by value."""
    is_signed: bool = False

    def __repr__(self) -> str:
        return f"<Type {str(self)[:160]}: {self.bytes} bytes>"

    @property
    def bare(self) -> Type:
        """The type without typedefs and qualifiers."""
        found = self
        while found.kind in QUALIFIERS and found.target is not None:
            found = found.target
        return found

    @property
    def bytes(self) -> int:
        """Size in bytes, including that of arrays and qualified types."""
        bare = self.bare
        if bare.kind == "array" and bare.target is not None:
            return bare.count * bare.target.bytes
        return bare.size

    @property
    def is_number(self) -> bool:
        """Whether a value of the type is a single int or float."""
        return self.bare.kind in ("signed", "unsigned", "char", "bool", "float", "enum", "pointer")

    def member(self, name: str) -> Member | None:
        """Return the member `name` of a struct or union, None if there is none. Unnamed members are searched too."""
        for one in self.bare.members:
            if one.name == name:
                return one
            if not one.name:
                inner = one.type.member(name)
                if inner is not None:
                    return Member(name, inner.type, one.offset + inner.offset, inner.bits, inner.lsb)
        return None

    def __str__(self) -> str:
        """Return the type name approximately as C writes it: `unsigned int`, `struct point *`, `char[8]`."""
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


MAX_NUMBER_BYTES: Final = 16
"""Largest plausible size of a number; the chip's compilers have none above 8 bytes."""
VOID: Final = Type("void", "void")
UNSIGNED: Final = {size: Type("unsigned", f"uint{8 * size}", size) for size in (1, 2, 4, 8)}
"""Types by size for symbols that have no debug information."""


def decode(kind: Type, data: bytes) -> Any:
    """Return the value of type `kind` in `data`.

    Raises ValueError if `data` is shorter than the type, as in damaged debug information."""
    bare = kind.bare
    if bare.kind not in ("array", "struct", "union") and (len(data) < bare.size or bare.size > MAX_NUMBER_BYTES):
        raise ValueError(f"the debug information is damaged: {kind} of {bare.size} bytes in {len(data)} bytes")
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
    """Return a member's value from the bytes of its struct or union."""
    inside = data[one.offset :]
    if not one.bits:
        return decode(one.type, inside)
    word = int.from_bytes(inside[: one.type.bytes], "little") >> one.lsb & (1 << one.bits) - 1
    if one.type.bare.is_signed and word >> one.bits - 1:
        word -= 1 << one.bits
    return word


def encode(kind: Type, value: Any) -> bytes:
    """Return `value` as bytes of type `kind`. Raises ValueError if it does not fit, TypeError for aggregates."""
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
    """Return a value as one line of text. Of a large object it shows the first MAX_SHOWN_NUMBERS numbers."""
    return _text_of(kind, value, [MAX_SHOWN_NUMBERS])


def _text_of(kind: Type, value: Any, left: list[int]) -> str:
    """Return the text of a value; `left` has the number of numbers that may still be shown."""
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
            return _array(bare.target, value, left)
        case "struct" | "union":
            named = [(f"{one.name} = ", one.type, value[one.name]) for one in bare.members if one.name]
            return _list(named, len(named), left)
    return str(value)


def _array(target: Type, values: list[Any], left: list[int]) -> str:
    if target.bare.kind == "char":
        octets = bytes(value & 0xFF for value in values)
        return repr(octets.rstrip(b"\0").decode("latin-1"))
    return _list([("", target, value) for value in values[:MAX_SHOWN_ELEMENTS]], len(values), left)


def _list(parts: list[tuple[str, Type, Any]], count: int, left: list[int]) -> str:
    """Return the parts in braces, as far as `left` permits; `count` is the number of all parts."""
    shown = []
    for name, kind, value in parts:
        if left[0] <= 0:
            break
        shown.append(name + _text_of(kind, value, left))
        left[0] -= kind.bare.kind not in ("array", "struct", "union")
    return "{" + ", ".join(shown + ["..."] * (len(shown) < count)) + "}"


def parts_of(kind: Type) -> Iterator[Member]:
    """Yield the members of a struct or union, or the elements of an array as members `[0]`, `[1]`, ..."""
    bare = kind.bare
    if bare.kind == "array" and bare.target is not None:
        step = bare.target.bytes
        for index in range(bare.count):
            yield Member(f"[{index}]", bare.target, step * index)
    yield from bare.members
