"""`as -g`: DWARF 2 line information for an assembly source (abi-elf.md §6.7).

Contents are built as plain DWARF bytes. `Section` stores them with phantom bytes, which doubles offsets of relocations.
A source with its own `.debug_line` section (compiler output) gets none.
"""

from __future__ import annotations

import os
from itertools import groupby

from emu.image.elf_facts import RELOCATION_BY_NAME
from toolchain.asm.directives.data import leb128
from toolchain.asm.sections import AsmSection, SectionPiece
from toolchain.asm.state import Assembler
from toolchain.asm.symbols import Label, LabelledSection
from toolchain.elf import constants as c
from toolchain.elf.model import Home, Reloc, Section, Symbol
from toolchain.errors import SourceLocation

LINE_BASE, LINE_RANGE, OPCODE_BASE = -5, 14, 10  # header of line programs of assembly (abi-elf.md §6.7)
ADDRESS_SIZE = 4
LANGUAGE = 0x8001  # DW_LANG_Mips_Assembler, which GNU as writes for assembly of every processor
PRODUCER = "OpenSwarm assembler"
_OPCODE_LENGTHS = bytes((0, 1, 1, 1, 1, 0, 0, 0, 1))  # operands of each standard opcode (DWARF 2 §6.2.4)
_COPY, _ADVANCE_PC, _ADVANCE_LINE, _SET_FILE = 1, 2, 3, 4  # DW_LNS_*, DWARF 2 §7.21
_END_SEQUENCE, _SET_ADDRESS = 1, 2  # DW_LNE_*
_COMPILE_UNIT = 0x11  # DW_TAG_compile_unit
_ATTRIBUTES = ((0x10, 0x06), (0x03, 0x08), (0x1B, 0x08), (0x25, 0x08), (0x13, 0x05))
"""(DW_AT, DW_FORM) codes of the unit: stmt_list data4; name, comp_dir, producer string; language data2."""

_R32 = RELOCATION_BY_NAME["32"].number


class _Bytes:
    """Content of a DWARF section and the relocations of its 4-byte fields."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.relocs: list[tuple[int, Symbol]] = []

    def word(self, value: int, symbol: Symbol | None = None) -> None:
        if symbol is not None:
            self.relocs.append((len(self.data), symbol))
        self.data += value.to_bytes(4, "little")

    def text(self, value: str) -> None:
        self.data += value.encode() + b"\0"

    def section(self, name: str) -> Section:
        doubled = bytearray(2 * len(self.data))
        doubled[::2] = self.data
        relocs = [Reloc(2 * offset, _R32, symbol) for offset, symbol in self.relocs]
        return Section(name, 0, c.SHT_NOTE, doubled, align=1, relocs=relocs)


def debug_sections(asm: Assembler, sections: dict[LabelledSection, Section]) -> tuple[list[Section], list[Symbol]]:
    """Return .debug_line, .debug_info, .debug_abbrev and their symbols; both lists are empty without instructions."""
    if not asm.line_rows or any(name.startswith(".debug_") for name in asm.sections):
        return [], []
    starts = {s: Symbol(s.name, Home.SECTION, s, type=c.STT_SECTION) for s in sections.values()}
    line = _line_program(asm, sections, starts).section(".debug_line")
    line_symbol = Symbol(".debug_line", Home.SECTION, line, type=c.STT_SECTION)
    abbrev = _Bytes()
    abbrev.data += bytes((1, _COMPILE_UNIT, 0))
    for pair in (*_ATTRIBUTES, (0, 0)):
        abbrev.data += bytes(pair)
    abbrev.data += b"\0"
    abbrev_section = abbrev.section(".debug_abbrev")
    abbrev_symbol = Symbol(".debug_abbrev", Home.SECTION, abbrev_section, type=c.STT_SECTION)
    info = _info(asm, line_symbol, abbrev_symbol).section(".debug_info")
    used = {r.symbol for r in line.relocs}
    return [line, info, abbrev_section], [line_symbol, abbrev_symbol, *(s for s in starts.values() if s in used)]


def _info(asm: Assembler, line: Symbol, abbrev: Symbol) -> _Bytes:
    body = _Bytes()
    body.word(0)
    body.data += b"\2\0"
    body.word(0, abbrev)
    body.data += bytes((ADDRESS_SIZE, 1))
    body.word(0, line)
    body.text(asm.options.recorded(asm.line_rows[0][1].file))
    body.text(asm.options.recorded(os.getcwd()))
    body.text(PRODUCER)
    body.data += LANGUAGE.to_bytes(2, "little")
    body.data[:4] = (len(body.data) - 4).to_bytes(4, "little")
    return body


def _line_program(asm: Assembler, sections: dict[LabelledSection, Section], starts: dict[Section, Symbol]) -> _Bytes:
    files = list(dict.fromkeys(place.file for _, place in asm.line_rows))
    out = _Bytes()
    out.word(0)
    out.data += b"\2\0"
    out.word(0)
    out.data += bytes((1, 1, LINE_BASE & 0xFF, LINE_RANGE, OPCODE_BASE)) + _OPCODE_LENGTHS
    out.data += b"\0"  # empty table of include directories: file names contain their folder
    for file in files:
        out.text(asm.options.recorded(file))
        out.data += b"\0\0\0"
    out.data += b"\0"
    out.data[6:10] = (len(out.data) - 10).to_bytes(4, "little")
    for source, rows in groupby(asm.line_rows, key=lambda row: _owner(row[0])):
        _sequence(out, list(rows), source, starts[sections[source]], {f: i + 1 for i, f in enumerate(files)})
    out.data[:4] = (len(out.data) - 4).to_bytes(4, "little")
    return out


def _owner(label: Label) -> AsmSection:
    assert isinstance(label.frag, SectionPiece)
    return label.frag.section


def _sequence(
    out: _Bytes, rows: list[tuple[Label, SourceLocation]], source: AsmSection, start: Symbol, files: dict[str, int]
) -> None:
    """Write the line sequence of one section: its start address, a row per instruction, the end of sequence."""
    addresses = [label.frag.start + label.offset for label, _ in rows]
    out.data += bytes((0, 1 + ADDRESS_SIZE, _SET_ADDRESS))
    out.word(addresses[0], start)
    address, file, line = addresses[0], 1, 1
    for at, (_, place) in zip(addresses, rows, strict=True):
        if files[place.file] != file:
            file = files[place.file]
            out.data += bytes((_SET_FILE,)) + leb128(file, signed=False)
        if at != address:
            out.data += bytes((_ADVANCE_PC,)) + leb128(at - address, signed=False)
        if place.line != line:
            out.data += bytes((_ADVANCE_LINE,)) + leb128(place.line - line, signed=True)
        out.data.append(_COPY)
        address, line = at, place.line
    last = rows[-1][0]
    length = _instruction_units(source, last)
    out.data += bytes((_ADVANCE_PC,)) + leb128(length, signed=False) + bytes((0, 1, _END_SEQUENCE))


def _instruction_units(source: AsmSection, label: Label) -> int:
    """Return the length of the instruction at `label` in address units."""
    from emu.dspic30f.isa import codec

    piece = next((p for p in source.pieces if p is label.frag), None)
    data = piece.data[label.offset * 2 :] if piece is not None else b""
    if piece is not None and not data:  # the instruction is the relaxable call in the next piece
        following = source.pieces[source.pieces.index(piece) + 1 :]
        data = next((p.data for p in following if p.data), b"")
    words = [int.from_bytes(data[i : i + 3], "little") for i in (0, 4)]
    insn = codec.decode_loosely(words[0], words[1])
    return 2 * insn.words if insn is not None else 2
