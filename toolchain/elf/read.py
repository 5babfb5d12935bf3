"""ELF32 reader for dsPIC30F objects and executables of this toolchain and of Microchip's tools (abi-elf.md §6).

Every link reads whole objects, so the reader is small and fast.  DWARF is read with pyelftools (`emu.image.lines`).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from emu.image.elf_facts import EM_DSPIC30F, EXT_ATTR_PREFIX, OCTETS_PER_UNIT, ExtendedAttribute, SectionFlag
from toolchain.elf import constants as c
from toolchain.elf.model import Bind, Executable, Home, ObjectFile, Reloc, Section, Symbol
from toolchain.errors import ToolError


@dataclass(slots=True)
class _Header:
    name: str
    type: int
    flags: int
    address: int
    offset: int
    size: int
    link: int
    info: int
    align: int


class _Reader:
    """Bounds-checked access to one file."""

    def __init__(self, data: bytes, name: str) -> None:
        self.data, self.name = data, name
        if data[:2] == c.COFF_MAGIC:
            raise self.error("a COFF file of an old C30: build it with -omf=elf")
        if data[:4] != c.MAGIC:
            raise self.error("not an ELF file (bad magic at offset 0)")
        if len(data) < c.EHDR_SIZE:
            raise self.error(f"truncated ELF header: {len(data)} of {c.EHDR_SIZE} bytes")
        if data[4] != c.ELFCLASS32 or data[5] != c.ELFDATA2LSB:
            raise self.error("not a 32-bit little-endian ELF file (offset 4)")
        (self.kind, machine, _, self.entry, self.phoff, self.shoff, self.flags, _, self.phentsize, self.phnum,
         shentsize, self.shnum, self.shstrndx) = struct.unpack_from("<HHIIIIIHHHHHH", data, 16)  # fmt: skip
        if machine != EM_DSPIC30F:
            raise self.error(f"machine {machine} at offset 18, expected {EM_DSPIC30F} (dsPIC30F)")
        if self.shnum and shentsize != c.SHDR_SIZE:
            raise self.error(f"section headers of {shentsize} bytes at offset 46, expected {c.SHDR_SIZE}")
        self.headers = self._headers()

    def error(self, message: str) -> ToolError:
        return ToolError(f"{self.name}: {message}")

    def slice(self, offset: int, size: int, what: str) -> bytes:
        if offset + size > len(self.data):
            raise self.error(f"{what} reaches offset {offset + size:#x}, file ends at {len(self.data):#x} (truncated?)")
        return self.data[offset : offset + size]

    def string(self, table: bytes, offset: int) -> str:
        if offset >= len(table):
            if offset == 0:
                return ""
            raise self.error(f"name offset {offset:#x} outside its string table")
        end = table.find(b"\0", offset)
        return table[offset : end if end >= 0 else len(table)].decode("utf-8", "surrogateescape")

    def _headers(self) -> list[_Header]:
        raw = self.slice(self.shoff, self.shnum * c.SHDR_SIZE, "section header table")
        rows = list(struct.iter_unpack("<10I", raw))
        names = b""
        if self.shstrndx < len(rows):
            names = self.slice(rows[self.shstrndx][4], rows[self.shstrndx][5], "section name table")
        return [_Header(self.string(names, r[0]), *r[1:9]) for r in rows]

    def content(self, header: _Header) -> bytes:
        return self.slice(header.offset, header.size, f"section {header.name}")

    def program_headers(self) -> list[tuple[int, ...]]:
        if self.phnum and self.phentsize != c.PHDR_SIZE:
            raise self.error(f"program headers of {self.phentsize} bytes at offset 42, expected {c.PHDR_SIZE}")
        raw = self.slice(self.phoff, self.phnum * c.PHDR_SIZE, "program header table")
        return list(struct.iter_unpack("<8I", raw))


_CONTENT_TYPES = (c.SHT_PROGBITS, c.SHT_NOBITS, c.SHT_NOTE)
_BINDS = {b.value: b for b in Bind}


def _sections(reader: _Reader) -> dict[int, Section]:
    """Return the sections with program content (no symbol, string or relocation tables), by section index."""
    found: dict[int, Section] = {}
    for index, header in enumerate(reader.headers):
        if header.type not in _CONTENT_TYPES:
            continue
        section = Section(header.name, header.flags, header.type, align=max(header.align, 1))
        section.address = section.load = header.address
        if header.type == c.SHT_NOBITS:
            section.nobits_units = header.size // OCTETS_PER_UNIT
        else:
            section.data = bytearray(reader.content(header))
        found[index] = section
    return found


def _symbols(reader: _Reader, sections: dict[int, Section]) -> list[Symbol]:
    """Return all symbols in file order, index 0 (the null symbol) included."""
    table = next((h for h in reader.headers if h.type == c.SHT_SYMTAB), None)
    if table is None:
        return []
    if table.link >= len(reader.headers):
        raise reader.error("the symbol table names no string table")
    names = reader.content(reader.headers[table.link])
    symbols: list[Symbol] = []
    for name_offset, value, size, info, other, where in struct.iter_unpack(
        "<IIIBBH", reader.slice(table.offset, table.size // c.SYM_SIZE * c.SYM_SIZE, "symbol table")
    ):
        symbol = Symbol(reader.string(names, name_offset), value=value, size=size)
        symbol.bind = _BINDS.get(info >> 4, Bind.GLOBAL)
        symbol.type, symbol.visibility = info & 15, other & 3
        if where == c.SHN_ABS:
            symbol.home = Home.ABSOLUTE
        elif where == c.SHN_COMMON:
            symbol.home = Home.COMMON
        elif where in sections:
            symbol.home, symbol.section = Home.SECTION, sections[where]
            if symbol.type == c.STT_SECTION:
                symbol.name = sections[where].name
        elif where != c.SHN_UNDEF:
            symbol.home = Home.ABSOLUTE
        symbols.append(symbol)
    return symbols


def _relocations(reader: _Reader, sections: dict[int, Section], symbols: list[Symbol]) -> None:
    for header in reader.headers:
        if header.type == c.SHT_RELA:
            raise reader.error(f"section {header.name}: dsPIC30F relocations keep the addend in place (SHT_REL)")
        if header.type != c.SHT_REL:
            continue
        target = sections.get(header.info)
        if target is None:
            raise reader.error(f"section {header.name} relocates section {header.info}, which does not exist")
        rows = reader.slice(header.offset, header.size // c.REL_SIZE * c.REL_SIZE, f"section {header.name}")
        for offset, info in struct.iter_unpack("<II", rows):
            if info >> 8 >= len(symbols):
                raise reader.error(
                    f"section {header.name}: relocation against symbol {info >> 8}, which does not exist"
                )
            target.relocs.append(Reloc(offset, info & 0xFF, symbols[info >> 8]))


def read_object(data: bytes, name: str) -> ObjectFile:
    """Return the relocatable object in `data`; `name` is used in messages.

    Raises `ToolError` if the file is damaged or no relocatable object (ET_REL) for the dsPIC30F.
    """
    reader = _Reader(data, name)
    if reader.kind != c.ET_REL:
        raise reader.error("not a relocatable object (an executable cannot be linked again)")
    sections = _sections(reader)
    symbols = _symbols(reader, sections)
    _relocations(reader, sections, symbols)
    by_name: dict[str, list[Section]] = {}
    for section in sections.values():
        by_name.setdefault(section.name, []).append(section)
    kept: list[Symbol] = []
    for symbol in symbols[1:]:
        if symbol.name.startswith(EXT_ATTR_PREFIX) and symbol.home is Home.ABSOLUTE:
            for section in by_name.get(symbol.name.removeprefix(EXT_ATTR_PREFIX), []):
                section.extended = ExtendedAttribute(symbol.value & 0x3F)
        else:
            kept.append(symbol)
    return ObjectFile(name, list(sections.values()), kept, reader.flags)


def read_executable(data: bytes, name: str) -> Executable:
    """Return the executable in `data`; LMAs of psv and eedata come from the program headers (abi-elf.md §6.4).

    Raises `ToolError` if the file is damaged or no executable (ET_EXEC) for the dsPIC30F.
    """
    reader = _Reader(data, name)
    if reader.kind != c.ET_EXEC:
        raise reader.error("not an executable (link it first)")
    sections = _sections(reader)
    segments = reader.program_headers()
    for index, section in sections.items():
        if section.flags & (SectionFlag.PSV | SectionFlag.EEDATA) and section.units:
            header = reader.headers[index]
            section.load = _load_address(header, segments)
    symbols = _symbols(reader, sections)
    return Executable(list(sections.values()), symbols[1:], reader.entry, reader.flags)


def _load_address(header: _Header, segments: list[tuple[int, ...]]) -> int:
    """Return the load address (LMA) of a psv or eedata section from its PT_LOAD (abi-elf.md §6.8 step 2)."""
    for kind, offset, vaddr, paddr, file_size, _, _, _ in segments:
        inside = offset <= header.offset and header.offset + header.size <= offset + file_size
        if kind == c.PT_LOAD and inside and vaddr <= header.address:
            return paddr + (header.address - vaddr)
    return header.address


def is_object(data: bytes) -> bool:
    """Return whether `data` starts like an ELF relocatable object."""
    return data[:4] == c.MAGIC and len(data) >= 18 and int.from_bytes(data[16:18], "little") == c.ET_REL
