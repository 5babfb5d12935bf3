"""ELF32 writer for dsPIC30F objects and executables (abi-elf.md §6 and §7)."""

from __future__ import annotations

import struct

from emu.image.elf_facts import EXT_ATTR_PREFIX, OCTETS_PER_UNIT, SectionFlag
from toolchain.elf import constants as c
from toolchain.elf.model import Bind, Executable, Home, ObjectFile, Section, Symbol
from toolchain.errors import ToolError


class _Strings:
    """A string table; equal strings share one offset."""

    def __init__(self) -> None:
        self.data = bytearray(1)
        self._seen: dict[str, int] = {"": 0}

    def add(self, text: str) -> int:
        if text not in self._seen:
            self._seen[text] = len(self.data)
            self.data += text.encode("utf-8", "surrogateescape") + b"\0"
        return self._seen[text]


class _Writer:
    """Writer with the file layout of Microchip's tools: headers, contents, names, section table, symbols (§6.4)."""

    def __init__(self, kind: int, processor: int, entry: int, program_headers: int) -> None:
        self.kind, self.processor, self.entry = kind, processor, entry
        self.body = bytearray(c.EHDR_SIZE + program_headers * c.PHDR_SIZE)
        self.headers: list[bytes] = [bytes(c.SHDR_SIZE)]
        self.names = _Strings()
        self.program_headers = program_headers

    def place(self, data: bytes | bytearray) -> int:
        """Append `data` on a 4-octet boundary and return its file offset."""
        self.body += bytes(-len(self.body) % 4)
        offset = len(self.body)
        self.body += data
        return offset

    def section(
        self, name: str, kind: int, flags: int, address: int, offset: int, size: int,
        *, link: int = 0, info: int = 0, align: int = 1, entry_size: int = 0,
    ) -> int:  # fmt: skip
        """Add one section header; return its index. Raise ToolError if ELF's section numbers are exhausted."""
        if len(self.headers) >= c.SHN_LORESERVE:
            raise ToolError(f"more than {c.SHN_LORESERVE - 1} sections: an ELF file cannot number them")
        self.headers.append(
            struct.pack(
                "<10I",
                self.names.add(name),
                kind,
                flags,
                address & 0xFFFFFFFF,
                offset,
                size,
                link,
                info,
                align,
                entry_size,
            )
        )
        return len(self.headers) - 1

    def finish(self, tables: list[tuple[int, bytes]]) -> bytes:
        """Write names, section headers and the deferred tables (symbols, strings), then the file header."""
        name_index = self.section(".shstrtab", c.SHT_STRTAB, 0, 0, 0, 0)
        names_offset = self.place(self.names.data)
        self._patch(name_index, names_offset, len(self.names.data))
        table_offset = self.place(bytes(len(self.headers) * c.SHDR_SIZE))
        for index, data in tables:
            self._patch(index, self.place(data), len(data))
        for index, header in enumerate(self.headers):
            start = table_offset + index * c.SHDR_SIZE
            self.body[start : start + c.SHDR_SIZE] = header
        ident = c.MAGIC + bytes((c.ELFCLASS32, c.ELFDATA2LSB, c.EV_CURRENT)) + bytes(9)
        phoff = c.EHDR_SIZE if self.program_headers else 0
        self.body[: c.EHDR_SIZE] = ident + struct.pack(
            "<HHIIIIIHHHHHH", self.kind, c.EM_DSPIC30F, c.EV_CURRENT, self.entry, phoff, table_offset, self.processor,
            c.EHDR_SIZE, c.PHDR_SIZE if self.program_headers else 0, self.program_headers, c.SHDR_SIZE,
            len(self.headers), name_index,
        )  # fmt: skip
        return bytes(self.body)

    def _patch(self, index: int, offset: int, size: int) -> None:
        values = list(struct.unpack("<10I", self.headers[index]))
        values[4], values[5] = offset, size
        self.headers[index] = struct.pack("<10I", *values)


def _content(writer: _Writer, section: Section) -> tuple[int, int]:
    """Place a section's octets; return (offset, size in octets).  NOBITS sizes are doubled too (§6.2)."""
    if section.type == c.SHT_NOBITS:
        return len(writer.body), section.nobits_units * OCTETS_PER_UNIT
    return writer.place(section.data), len(section.data)


def _symbol_table(symbols: list[Symbol], index_of: dict[Section, int]) -> tuple[bytes, bytes, int, dict[Symbol, int]]:
    """Return (.symtab, .strtab, number of locals, index of each symbol); locals precede globals, as ELF requires."""
    strings = _Strings()
    ordered = [s for s in symbols if s.bind is Bind.LOCAL] + [s for s in symbols if s.bind is not Bind.LOCAL]
    rows = [bytes(c.SYM_SIZE)]
    numbers: dict[Symbol, int] = {}
    homes = {Home.UNDEFINED: c.SHN_UNDEF, Home.ABSOLUTE: c.SHN_ABS, Home.COMMON: c.SHN_COMMON}
    for symbol in ordered:
        numbers[symbol] = len(rows)
        where = index_of[symbol.section] if symbol.section is not None else homes[symbol.home]
        info = symbol.bind.value << 4 | symbol.type
        name = 0 if symbol.type == c.STT_SECTION else strings.add(symbol.name)
        rows.append(
            struct.pack("<IIIBBH", name, symbol.value & 0xFFFFFFFF, symbol.size, info, symbol.visibility, where)
        )
    locals_count = 1 + sum(s.bind is Bind.LOCAL for s in symbols)
    return b"".join(rows), bytes(strings.data), locals_count, numbers


def _add_symbols(writer: _Writer, table: bytes, strings: bytes, local_count: int) -> list[tuple[int, bytes]]:
    index = writer.section(
        ".symtab",
        c.SHT_SYMTAB,
        0,
        0,
        0,
        0,
        link=len(writer.headers) + 1,
        info=local_count,
        align=4,
        entry_size=c.SYM_SIZE,
    )
    return [(index, table), (writer.section(".strtab", c.SHT_STRTAB, 0, 0, 0, 0), strings)]


def object_bytes(obj: ObjectFile) -> bytes:
    """Return `obj` as an ET_REL file: `.rel` sections, addends in the fields, `__ext_attr_` symbols (§7 item 8)."""
    writer = _Writer(c.ET_REL, obj.processor, 0, 0)
    index_of: dict[Section, int] = {}
    for section in obj.sections:
        offset, size = _content(writer, section)
        index_of[section] = writer.section(
            section.name, section.type, section.flags, section.load, offset, size, align=section.align
        )
    symbols = list(obj.symbols)
    for section in obj.sections:
        if section.extended:
            name = EXT_ATTR_PREFIX + section.name
            symbols.append(Symbol(name, Home.ABSOLUTE, value=int(section.extended)))
    table, strings, local_count, numbers = _symbol_table(symbols, index_of)
    with_relocs = [s for s in obj.sections if s.relocs]
    symtab_index = len(writer.headers) + len(with_relocs)
    for section in with_relocs:
        rows = b"".join(struct.pack("<II", r.offset, numbers[r.symbol] << 8 | r.type) for r in section.relocs)
        writer.section(
            ".rel" + section.name, c.SHT_REL, 0, 0, writer.place(rows), len(rows),
            link=symtab_index, info=index_of[section], align=4, entry_size=c.REL_SIZE,
        )  # fmt: skip
    return writer.finish(_add_symbols(writer, table, strings, local_count))


def executable_bytes(image: Executable) -> bytes:
    """Return `image` as an ET_EXEC file with one PT_LOAD per section that is loaded (§7 items 1-5)."""
    loaded = [s for s in image.sections if s.flags & SectionFlag.ALLOC]
    writer = _Writer(c.ET_EXEC, image.processor, image.entry, len(loaded))
    index_of: dict[Section, int] = {}
    segments: list[bytes] = []
    for section in image.sections:
        offset, size = _content(writer, section)
        index_of[section] = writer.section(
            section.name, section.type, section.flags, section.address, offset, size, align=section.align
        )
        if section.flags & SectionFlag.ALLOC:
            file_size = 0 if section.type == c.SHT_NOBITS else size
            rights = c.PF_R | (c.PF_X if section.is_code else 0) | (c.PF_W if section.is_ram else 0)
            segments.append(
                struct.pack("<8I", c.PT_LOAD, offset, section.address, section.load, file_size, size, rights, 2)
            )
    start = c.EHDR_SIZE
    writer.body[start : start + len(segments) * c.PHDR_SIZE] = b"".join(segments)
    table, strings, local_count, _ = _symbol_table(image.symbols, index_of)
    return writer.finish(_add_symbols(writer, table, strings, local_count))
