"""Reader of dsPIC30F ELF executables: program words, sections and symbols, as specified by abi-elf.md §6.8.

Input: contents of a file written by this project's linker, XC16 or C30. Output: an `Image`. The contents come from
section headers; program headers only translate the addresses of psv and EEPROM sections (abi-elf.md §6.4).
"""

from __future__ import annotations

import struct
import sys
from array import array
from typing import Final, NamedTuple

from emu.chips import NAMES, chip_named, chip_of
from emu.chips.chip import Chip
from emu.chips.members import MEMBERS, nearest
from emu.image.elf_facts import EM_DSPIC30F, OCTETS_PER_UNIT, OCTETS_PER_WORD, PROCESSOR_MASK, SectionFlag
from emu.image.model import Block, Image, LoadError, Section, check_blocks
from emu.image.symbols import Symbol

ET_REL, ET_EXEC = 1, 2
SHT_PROGBITS, SHT_SYMTAB, SHT_STRTAB, SHT_NOTE, SHT_NOBITS = 1, 2, 3, 7, 8
PT_LOAD = 1
SHN_UNDEF, SHN_LORESERVE, SHN_ABS = 0, 0xFF00, 0xFFF1
STB_LOCAL = 0
INITIAL_DATA: Final = ".dinit"
"""Section that has code flags but no instructions: the table from which crt0 initialises RAM (abi-elf.md §3.2)."""
STT_KINDS: Final = {0: "label", 1: "object", 2: "function"}

_HEADER: Final = struct.Struct("<16sHHIIIIIHHHHHH")
_SECTION: Final = struct.Struct("<10I")
_SEGMENT: Final = struct.Struct("<8I")
_SYMBOL: Final = struct.Struct("<IIIBBH")

_MACHINES: Final = {2: "SPARC", 3: "x86", 8: "MIPS", 40: "ARM", 62: "x86-64", 83: "AVR", 105: "MSP430", 183: "AArch64",
                    204: "PIC18", 243: "RISC-V"}  # fmt: skip
"""Machine names by ELF e_machine number, for the error message."""


class _Header(NamedTuple):
    name: int
    type: int
    flags: int
    address: int
    offset: int
    size: int
    link: int
    info: int
    align: int
    entry_size: int


class _Segment(NamedTuple):
    type: int
    offset: int
    vaddr: int
    paddr: int
    file_size: int
    mem_size: int
    flags: int
    align: int


class _Reader:
    """File being read. Every access is checked against the file's length."""

    def __init__(self, data: bytes, path: str) -> None:
        self.data: Final = data
        self.path: Final = path
        self.warnings: Final[list[str]] = []

    def fail(self, message: str) -> LoadError:
        return LoadError(self.path, message)

    def piece(self, offset: int, size: int, what: str) -> bytes:
        """Return `size` octets at `offset`. Raises LoadError if the file is shorter."""
        if offset + size > len(self.data):
            raise self.fail(
                f"is truncated: {what} needs octets {offset:#x}..{offset + size:#x}, the file has {len(self.data):#x}"
            )
        return self.data[offset : offset + size]

    def table(self, row: struct.Struct, offset: int, count: int, size: int, what: str) -> list[tuple[int, ...]]:
        """Return the rows of a header table. Raises LoadError if the entry size `size` does not match the format."""
        if count and size != row.size:
            raise self.fail(f"{what} entries have {size} octets, expected {row.size}")
        return list(row.iter_unpack(self.piece(offset, count * row.size, what)))


def read_elf(data: bytes, path: str, chip: Chip | None) -> Image:
    """Read the contents of an ELF file for `chip`; with None, for the chip named in the file.

    Raises LoadError if it is not a complete dsPIC30F executable.
    """
    reader = _Reader(data, path)
    (_, _, _, _, entry, phoff, shoff, e_flags, _, phentsize, phnum, shentsize, shnum, shstrndx) = _identify(reader)
    processor = e_flags & PROCESSOR_MASK
    chip = chip or _chip_of_file(reader, processor)
    if processor not in chip.processors:
        named = MEMBERS.get(processor)
        built = f"the {named}" if named else f"processor id {processor:#x}"
        reader.warnings.append(f"built for {built}, not for the {chip.name} ({chip.processors[0]:#x}); loaded for that")
    headers = [_Header(*row) for row in reader.table(_SECTION, shoff, shnum, shentsize, "the section header table")]
    segments = [_Segment(*row) for row in reader.table(_SEGMENT, phoff, phnum, phentsize, "the program header table")]
    if not headers:
        raise reader.fail("has no section headers; words are found through them, so do not strip them")
    names = _strings(reader, headers, shstrndx)
    sections = [_section(reader, header, _name(names, header.name), segments) for header in headers]
    blocks = [_block(reader, section) for section in sections if section.load_address is not None and section.octets]
    placed = check_blocks(path, chip, blocks)
    if not placed:
        raise reader.fail("holds no program words: no section is marked as code, psv or EEPROM")
    symbols = _symbols(reader, headers, sections)
    return Image(path, "elf", chip, placed, tuple(sections), symbols, entry, tuple(reader.warnings))


def _chip_of_file(reader: _Reader, processor: int) -> Chip:
    """Return the chip for a processor id; the default chip for an id outside the family.

    Raises LoadError for a member of the family without tables.
    """
    chip = chip_of(processor)
    if chip is None and processor in MEMBERS:
        member = MEMBERS[processor]
        raise reader.fail(
            f"is built for the {member}, which is not modelled (modelled: {', '.join(NAMES)}); `--chip"
            f" {nearest(member).removeprefix('dsPIC')}` loads it for the nearest of them"
        )
    return chip or chip_named()


def _identify(reader: _Reader) -> tuple[int, ...]:
    """Return the file header's fields, after checking that this is a dsPIC30F executable (abi-elf.md §6.1)."""
    fields = _HEADER.unpack(reader.piece(0, _HEADER.size, "the ELF header"))
    ident, kind, machine = fields[:3]
    if machine != EM_DSPIC30F:
        known = _MACHINES.get(machine, "an unknown machine")
        cure = "; `emu run --board kilobot` runs images for the Kilobot's AVR" if known == "AVR" else ""
        raise reader.fail(f"is built for {known} (e_machine {machine}), expected dsPIC30F ({EM_DSPIC30F}){cure}")
    if ident[4] != 1 or ident[5] != 1:
        raise reader.fail(f"has ELF class {ident[4]}, data encoding {ident[5]}; expected 1 (32 bit), 1 (little endian)")
    if kind == ET_REL:
        raise reader.fail("is an object file; link it into an executable first")
    if kind != ET_EXEC:
        raise reader.fail(f"has ELF type {kind}, expected {ET_EXEC} (executable)")
    return fields


def _strings(reader: _Reader, headers: list[_Header], index: int) -> bytes:
    """Return the string table in section `index`, empty if there is none."""
    if not 0 < index < len(headers) or headers[index].type != SHT_STRTAB:
        return b""
    return reader.piece(headers[index].offset, headers[index].size, "a string table")


def _name(strings: bytes, offset: int) -> str:
    """Return the NUL-terminated name at `offset`, empty if `offset` is outside the table."""
    end = strings.find(b"\0", offset)
    return strings[offset : end if end >= 0 else len(strings)].decode("latin-1")


def _kind(header: _Header) -> str:
    """Return the kind of a section from its flags (abi-elf.md §6.3)."""
    if not header.flags & SectionFlag.ALLOC:
        return "info"
    if header.type == SHT_NOBITS:
        return "bss"
    if header.flags & SectionFlag.EXECINSTR:
        return "code"
    if header.flags & SectionFlag.PSV:
        return "psv"
    return "eedata" if header.flags & SectionFlag.EEDATA else "data"


def _section(reader: _Reader, header: _Header, name: str, segments: list[_Segment]) -> Section:
    """Read the content and load address of one section (abi-elf.md §6.8 step 2)."""
    kind = _kind(header)
    has_octets = header.type != SHT_NOBITS and header.size > 0
    octets = reader.piece(header.offset, header.size, f"section {name!r}") if has_octets else b""
    load_address: int | None = None
    if header.type == SHT_PROGBITS and not header.flags & SectionFlag.NOLOAD and header.size:
        if kind == "code":
            load_address = header.address
        elif kind in ("psv", "eedata"):
            load_address = _load_address(reader, header, name, segments)
        elif kind == "data":
            reader.warnings.append(f"section {name!r} initialises RAM without start-up code; not loaded")
    size = -(-header.size // OCTETS_PER_UNIT)
    return Section(name, kind, header.address, size, header.flags, load_address, octets)


def _load_address(reader: _Reader, header: _Header, name: str, segments: list[_Segment]) -> int:
    """Return the program address of a psv or EEPROM section, from its program header (abi-elf.md §6.4)."""
    for segment in segments:
        if (
            segment.type == PT_LOAD
            and segment.offset <= header.offset
            and header.offset + header.size <= segment.offset + segment.file_size
            and segment.vaddr <= header.address
        ):
            return segment.paddr + header.address - segment.vaddr
    raise reader.fail(f"section {name!r}: no program header gives its load address")


def _block(reader: _Reader, section: Section) -> Block:
    """Return the program words of a loadable section, without phantom octets."""
    base = section.load_address
    assert base is not None
    what = f"section {section.name!r}"
    if base % 2 or section.address % 2:
        raise reader.fail(f"{what} starts at the odd address {section.address:#x} (program address {base:#x})")
    octets = section.octets
    if len(octets) % OCTETS_PER_WORD:
        reader.warnings.append(f"{what}: {len(octets)} octets are not whole program words; filled up with zeros")
        octets += bytes(-len(octets) % OCTETS_PER_WORD)
    words = array("I", octets)
    if sys.byteorder == "big":
        words.byteswap()
    if max(words) > 0xFFFFFF:
        bad = next(index for index, word in enumerate(words) if word > 0xFFFFFF)
        reader.warnings.append(f"{what}: fourth octet of the word at {base + 2 * bad:#08x} is not 0 (ignored)")
        words = array("I", [word & 0xFFFFFF for word in words])
    return Block(base, words, what, section.kind == "code" and section.name != INITIAL_DATA)


def _symbols(reader: _Reader, headers: list[_Header], sections: list[Section]) -> tuple[Symbol, ...]:
    """Return the named, defined symbols of all symbol tables (abi-elf.md §6.5)."""
    found: list[Symbol] = []
    for header in headers:
        if header.type != SHT_SYMTAB:
            continue
        strings = _strings(reader, headers, header.link)
        table = reader.piece(header.offset, header.size // _SYMBOL.size * _SYMBOL.size, "the symbol table")
        for name, value, size, info, _, index in _SYMBOL.iter_unpack(table):
            kind = STT_KINDS.get(info & 0xF)
            text = _name(strings, name)
            if kind is None or index == SHN_UNDEF or not text:
                continue
            space, load = "absolute", None
            if index < len(sections):
                section = sections[index]
                space = "data" if section.kind in ("data", "bss") else section.kind
                if section.load_address is not None:
                    load = section.load_address + value - section.address
            elif index != SHN_ABS:
                continue
            found.append(Symbol(text, value, size, kind, space, info >> 4 != STB_LOCAL, load))
    return tuple(found)
