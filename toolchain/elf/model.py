"""Model of object files and executables.

Contents are stored as in the file (abi-elf.md §6.2): four octets per program word in code,
every byte followed by a phantom octet elsewhere.  Addresses and sizes are in address units.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from emu.image.elf_facts import OCTETS_PER_UNIT, ExtendedAttribute, SectionFlag
from toolchain.elf import constants as c

NO_ATTRIBUTES = ExtendedAttribute(0)


class Bind(Enum):
    """Symbol binding with the numbers of ELF."""

    LOCAL = c.STB_LOCAL
    GLOBAL = c.STB_GLOBAL
    WEAK = c.STB_WEAK


class Home(Enum):
    """Where a symbol is defined: in a section, or one of ELF's special section indices."""

    SECTION = "section"
    UNDEFINED = "undefined"
    ABSOLUTE = "absolute"
    COMMON = "common"


@dataclass(slots=True, eq=False)
class Symbol:
    """One symbol.  `value` is section-relative in objects, an address in executables; for COMMON the alignment."""

    name: str
    home: Home = Home.UNDEFINED
    section: Section | None = None
    value: int = 0
    size: int = 0
    bind: Bind = Bind.LOCAL
    type: int = c.STT_NOTYPE
    visibility: int = c.STV_DEFAULT


@dataclass(slots=True)
class Reloc:
    """A relocation: `offset` in octets from the section start (abi-elf.md §5), `type` a RelocationType of elf_facts."""

    offset: int
    type: int
    symbol: Symbol


@dataclass(slots=True, eq=False)
class Section:
    """One section.  `nobits_units` is the length of a section without content."""

    name: str
    flags: int = 0
    type: int = c.SHT_PROGBITS
    data: bytearray = field(default_factory=bytearray)
    nobits_units: int = 0
    align: int = 2
    address: int = 0
    load: int = 0
    relocs: list[Reloc] = field(default_factory=list, repr=False)
    extended: ExtendedAttribute = NO_ATTRIBUTES

    @property
    def units(self) -> int:
        """Length in address units; always octets / 2 (abi-elf.md §6.2)."""
        return self.nobits_units if self.type == c.SHT_NOBITS else (len(self.data) + 1) // OCTETS_PER_UNIT

    @property
    def is_code(self) -> bool:
        return bool(self.flags & SectionFlag.EXECINSTR)

    @property
    def is_ram(self) -> bool:
        return bool(self.flags & SectionFlag.WRITE and self.flags & SectionFlag.ALLOC)

    @property
    def is_psv(self) -> bool:
        return bool(self.flags & SectionFlag.PSV)

    @property
    def is_eedata(self) -> bool:
        return bool(self.flags & SectionFlag.EEDATA)


@dataclass(slots=True)
class ObjectFile:
    """A relocatable object: its origin (file or archive member), its sections and its symbols."""

    name: str
    sections: list[Section] = field(default_factory=list)
    symbols: list[Symbol] = field(default_factory=list)
    processor: int = 0


@dataclass(slots=True)
class Executable:
    """A linked image: sections with final addresses, symbols with final values, entry in PC units."""

    sections: list[Section]
    symbols: list[Symbol]
    entry: int
    processor: int
