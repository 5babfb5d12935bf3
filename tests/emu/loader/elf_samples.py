"""ELF files with the layout of XC16's linker (abi-elf.md §6), valid and damaged, for tests of the loader."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from emu.image.elf_facts import EM_DSPIC30F, SectionFlag

CODE = int(SectionFlag.ALLOC | SectionFlag.EXECINSTR)
PSV = int(SectionFlag.ALLOC | SectionFlag.PSV)
EEDATA = int(SectionFlag.ALLOC | SectionFlag.EEDATA)
DATA_COPY = int(SectionFlag.ALLOC | SectionFlag.WRITE | SectionFlag.NEAR | SectionFlag.NOLOAD)
BSS = int(SectionFlag.ALLOC | SectionFlag.WRITE | SectionFlag.NEAR)
PROGBITS, SYMTAB, STRTAB, NOTE, NOBITS = 1, 2, 3, 7, 8


def words(*values: int) -> bytes:
    """Return program words as four octets each: low, middle, upper, phantom 0."""
    return b"".join(struct.pack("<I", value) for value in values)


def doubled(data: bytes) -> bytes:
    """Return bytes with a phantom octet after each, as data and debug sections are stored."""
    return b"".join(bytes((octet, 0)) for octet in data)


@dataclass
class SampleSection:
    """Section of a sample. `load_address` gives it a program header, as psv and EEPROM sections need."""

    name: str
    address: int
    content: bytes
    flags: int = CODE
    kind: int = PROGBITS
    load_address: int | None = None
    size: int | None = None


@dataclass
class Name:
    """Symbol of a sample. `section` is an index into the parts, or None for an absolute symbol."""

    text: str
    value: int
    section: int | None = 0
    size: int = 0
    kind: int = 0
    binding: int = 1


@dataclass
class ElfSample:
    """Executable of `parts` and `names`. Header fields can be changed for negative tests."""

    parts: list[SampleSection] = field(default_factory=list)
    names: list[Name] = field(default_factory=list)
    machine: int = EM_DSPIC30F
    type: int = 2
    flags: int = 0x1F
    entry: int = 0x100
    ident: bytes = b"\x7fELF\x01\x01\x01" + bytes(9)

    def build(self) -> bytes:
        """Return the file: header, program headers, contents, section header table, then symbols (§6.4)."""
        segments = [part for part in self.parts if part.kind == PROGBITS and part.flags & SectionFlag.ALLOC]
        place = 52 + 32 * len(segments)
        body, programs, headers = b"", b"", [bytes(40)]
        section_names = b"\0"
        offsets = []
        for part in self.parts:
            offset = place + len(body)
            size = len(part.content) if part.size is None else part.size
            body += part.content
            if part in segments:
                load = part.address if part.load_address is None else part.load_address
                programs += struct.pack("<8I", 1, offset, part.address, load, size, size, 5, 2)
            offsets.append(len(section_names))
            section_names += part.name.encode() + b"\0"
            headers.append(
                struct.pack("<10I", offsets[-1], part.kind, part.flags, part.address, offset, size, 0, 0, 2, 0)
            )
        symbols, strings = bytes(16), b"\0"
        for name in self.names:
            index = 0xFFF1 if name.section is None else name.section + 1
            info = name.binding << 4 | name.kind
            symbols += struct.pack("<IIIBBH", len(strings), name.value, name.size, info, 0, index)
            strings += name.text.encode() + b"\0"
        start = place + len(body)
        for kind, content, link, entry_size in (
            (SYMTAB, symbols, len(headers) + 1, 16),
            (STRTAB, strings, 0, 0),
            (STRTAB, section_names, 0, 0),
        ):
            headers.append(struct.pack("<10I", 0, kind, 0, 0, start, len(content), link, 1, 1, entry_size))
            body += content
            start += len(content)
        header = struct.pack(
            "<16sHHIIIIIHHHHHH",
            self.ident, self.type, self.machine, 1, self.entry, 52, start, self.flags,
            52, 32, len(segments), 40, len(headers), len(headers) - 1,
        )  # fmt: skip
        return header + programs + body + b"".join(headers)


def xc16_like() -> ElfSample:
    """Return an executable with one section of every kind in an XC16 executable (abi-elf.md §6.3); several sections
    share a name."""
    return ElfSample(
        parts=[
            SampleSection(".reset", 0x000000, words(0x040100, 0x000000)),
            SampleSection(".ivt", 0x000004, words(*[0x000108] * 62)),
            SampleSection(".text", 0x000100, words(0x200010, 0x200021, 0xDA4000, 0xFE0000, 0x060000)),
            SampleSection(".text", 0x000200, words(0x060000, 0x37FFFF)),
            SampleSection(".const", 0x8180, words(0x00BBAA, 0x00DDCC), PSV, load_address=0x10180),
            SampleSection(".ndata", 0x0800, doubled(b"\x12\x34"), DATA_COPY),
            SampleSection(".nbss", 0x0802, b"", BSS, NOBITS, size=8),
            SampleSection(".eedata", 0xF000, words(0x001234), EEDATA, load_address=0x7FF000),
            SampleSection("__FOSC.sec", 0xF80000, words(0x00C706)),
        ],
        names=[
            Name("__reset", 0x100, 2), Name("_main", 0x104, 2, size=6, kind=2), Name(".L3", 0x106, 2, binding=0),
            Name("_helper", 0x200, 3, size=4, kind=2), Name("_table", 0x8180, 4, size=4, kind=1),
            Name("_counter", 0x0800, 5, size=2, kind=1), Name("_buffer", 0x0802, 6, size=4, kind=1),
            Name("_PORTA", 0x02C2, None),
        ],
    )  # fmt: skip
