"""Translation of `.section` names and attributes to section flags (abi-elf.md §4.3 and §6.3)."""

from __future__ import annotations

import re
from dataclasses import dataclass

from emu.image.elf_facts import ExtendedAttribute, SectionFlag
from toolchain.asm.expr import ExprError
from toolchain.asm.macro import split_arguments
from toolchain.elf import constants as c

_F = SectionFlag
_CODE, _DATA = _F.ALLOC | _F.EXECINSTR, _F.ALLOC | _F.WRITE
_TYPES: dict[str, tuple[SectionFlag, int, ExtendedAttribute]] = {
    "code": (_CODE, c.SHT_PROGBITS, ExtendedAttribute(0)),
    "data": (_DATA, c.SHT_PROGBITS, ExtendedAttribute(0)),
    "bss": (_DATA, c.SHT_NOBITS, ExtendedAttribute(0)),
    "persist": (_DATA | _F.PERSIST, c.SHT_NOBITS, ExtendedAttribute(0)),
    "psv": (_F.ALLOC | _F.PSV, c.SHT_PROGBITS, ExtendedAttribute(0)),
    "eedata": (_F.ALLOC | _F.EEDATA, c.SHT_PROGBITS, ExtendedAttribute(0)),
    "heap": (_DATA, c.SHT_NOBITS, ExtendedAttribute.HEAP),
    "stack": (_DATA, c.SHT_NOBITS, ExtendedAttribute.STACK),
}
_MODIFIERS: dict[str, SectionFlag] = {
    "near": _F.NEAR,
    "xmemory": _F.XMEM,
    "ymemory": _F.YMEM,
    "noload": _F.NOLOAD,
}
OMITTED = _F.NEAR | _F.XMEM | _F.YMEM | _F.NOLOAD | _F.ABSOLUTE | _F.REVERSE
"""Attributes that a repeated `.section` directive inherits from the first one of the same name if it omits them."""
_RESERVED: dict[str, str] = {
    ".text": "code",
    ".data": "data",
    ".bss": "bss",
    ".nbss": "bss,near",
    ".ndata": "data,near",
    ".xbss": "bss,xmemory",
    ".xdata": "data,xmemory",
    ".ybss": "bss,ymemory",
    ".ydata": "data,ymemory",
    ".pbss": "persist",
    ".dconst": "data",
    ".ndconst": "data,near",
    ".eedata": "eedata",
    ".const": "psv,page",  # pic30-as assigns a wrong type to a bare .const (§4.3)
}
_OTHER_PARTS = frozenset(("eds", "dma", "boot", "secure", "auxflash", "packedflash", "memory"))


@dataclass(slots=True)
class Attributes:
    """The parsed attribute list of a `.section`."""

    flags: int
    type: int
    extended: ExtendedAttribute
    align: int | None = None
    address: int | None = None
    keep: bool = False


def implied(name: str) -> str:
    """Return the default attributes of a section name: data unless the name is reserved (§4.3)."""
    return _RESERVED.get(name, "info" if name.startswith(".debug_") else "data")


def _from_quoted(flags: str) -> str:
    """Translate deprecated quoted flags ("ax") to an attribute."""
    for letter, meaning in (("x", "code"), ("b", "bss"), ("w", "data"), ("d", "data"), ("r", "psv")):
        if letter in flags:
            return meaning
    return "data"


def parse(text: str, name: str = "") -> Attributes:
    """Parse `code, address(0x1000), near ...`; raise `ExprError` for unknown or contradictory attributes.

    Without a type attribute the type is that of the section's `name`: `.section .bss, near`.
    """
    result = Attributes(0, c.SHT_PROGBITS, ExtendedAttribute(0))
    kind, info = "", False
    for word in split_arguments(text, spaces=False):
        if len(word) >= 2 and word[0] == word[-1] == '"':
            word = _from_quoted(word[1:-1])
        match = re.fullmatch(r"(\w+)\s*(?:\(\s*([^()]*?)\s*\))?", word)
        if match is None:
            raise ExprError(f"cannot read section attribute {word!r}")
        attribute, argument = match[1].lower(), match[2]
        if attribute in _TYPES:
            if kind:
                raise ExprError(f"a section cannot be both {kind} and {attribute}")
            kind = attribute
        elif attribute in _MODIFIERS:
            result.flags |= _MODIFIERS[attribute]
        elif attribute in ("address", "reverse", "align", "merge"):
            _with_number(result, attribute, argument)
        elif attribute == "page":
            result.extended |= ExtendedAttribute.PAGE
        elif attribute == "keep":
            result.keep = True
        elif attribute == "info":
            info = True
        elif attribute in _OTHER_PARTS:
            raise ExprError(f"section attribute {attribute} is for parts other than the 30F6014A")
        else:
            raise ExprError(f"unknown section attribute {attribute!r}")
    kind = kind or implied(name).partition(",")[0].replace("info", "data")
    _apply_type(result, kind)
    if info:
        _make_info(result, kind)
    return result


def _with_number(result: Attributes, name: str, argument: str | None) -> None:
    try:
        number = int(argument or "", 0)
    except ValueError:
        raise ExprError(f"section attribute {name} needs a number, got {argument!r}") from None
    if name == "address":
        result.address = number
        result.flags |= SectionFlag.ABSOLUTE
        return
    if name == "merge":
        return  # `merge` is ignored: the linker does not merge duplicate constants
    if number < 1 or number & (number - 1) or number > 0x8000:
        raise ExprError(f"{name}({number}) is not a power of two up to 32768")
    result.align = number
    if name == "reverse":
        result.flags |= SectionFlag.REVERSE


def _apply_type(result: Attributes, kind: str) -> None:
    flags, result.type, extended = _TYPES[kind]
    data_only = SectionFlag.NEAR | SectionFlag.XMEM | SectionFlag.YMEM | SectionFlag.REVERSE
    if result.flags & data_only and not flags & SectionFlag.WRITE:
        raise ExprError(f"near, xmemory, ymemory and reverse are for data sections, not for {kind}")
    if result.flags & SectionFlag.XMEM and result.flags & SectionFlag.YMEM:
        raise ExprError("a section cannot be in both X and Y memory")
    result.flags |= flags
    result.extended |= extended


def _make_info(result: Attributes, kind: str) -> None:
    """Apply `info` (also written `info, data`): the section occupies no memory of the chip; only tools read it."""
    if kind != "data" or result.flags != _DATA:
        raise ExprError("an info section has no place in memory and takes no other attributes")
    result.flags, result.type = 0, c.SHT_NOTE
