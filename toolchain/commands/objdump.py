"""Command `objdump`: print the contents of an object or executable."""

from __future__ import annotations

import argparse

from emu.image.elf_facts import RELOCATIONS, SectionFlag
from toolchain.commands.nm import letter
from toolchain.commands.parser import parser
from toolchain.elf import constants as c
from toolchain.elf.disassemble import CodeItem, Names, items, text_of
from toolchain.elf.model import Executable, Home, ObjectFile, Section
from toolchain.elf.read import is_object, read_executable, read_object
from toolchain.elf.source_lines import LineTable, SourceText, lines_of
from toolchain.errors import ToolError
from toolchain.files import read_bytes

VECTOR_TABLES = (".ivt", ".aivt")
_FLAG_WORDS = (
    (SectionFlag.ALLOC, "ALLOC"), (SectionFlag.WRITE, "DATA"), (SectionFlag.EXECINSTR, "CODE"),
    (SectionFlag.NEAR, "NEAR"), (SectionFlag.XMEM, "XMEMORY"), (SectionFlag.YMEM, "YMEMORY"),
    (SectionFlag.PSV, "PSV"), (SectionFlag.EEDATA, "EEDATA"), (SectionFlag.PERSIST, "PERSIST"),
    (SectionFlag.NOLOAD, "NEVER_LOAD"), (SectionFlag.ABSOLUTE, "ABSOLUTE"), (SectionFlag.REVERSE, "REVERSE"),
)  # fmt: skip


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    p = parser(
        "objdump",
        "Show parts of an object or executable.",
        "python -m toolchain objdump -S firmware.elf",
        help_switches=("--help",),  # -h prints section headers, as in GNU objdump
    )
    p.add_argument("files", nargs="+", metavar="FILE")
    p.add_argument("-d", "--disassemble", action="store_true", help="instructions of code sections")
    p.add_argument("-S", "--source", action="store_true", help="as -d, with source lines from DWARF")
    p.add_argument("-h", "--headers", action="store_true", help="sections")
    p.add_argument("-t", "--syms", action="store_true", help="symbols")
    p.add_argument("-r", "--reloc", action="store_true", help="relocations (within -d, beside the instruction)")
    p.add_argument("-j", "--section", action="append", default=[], metavar="NAME", help="only this section")
    p.add_argument("--start", metavar="SYMBOL", help="only from this function to its end")
    return p


def main(arguments: list[str]) -> int:
    """Print the selected parts; return 0."""
    options = options_of().parse_args(arguments)
    if not (options.disassemble or options.source or options.headers or options.syms or options.reloc):
        raise ToolError("nothing to show: give -d, -S, -h, -t or -r")
    for name in options.files:
        data = read_bytes(name)
        image: ObjectFile | Executable = (read_object if is_object(data) else read_executable)(data, name)
        print(f"{name}: elf32-pic30, processor id {image.processor & 0xFFFF:#x}")
        sections = [s for s in image.sections if not options.section or s.name in options.section]
        if options.headers:
            _headers(sections)
        if options.syms:
            _symbols(image)
        if options.reloc and not (options.disassemble or options.source):
            _relocations(sections)
        if options.disassemble or options.source:
            _disassembly(image, sections, options.source, options.reloc, options.start)
    return 0


def _headers(sections: list[Section]) -> None:
    print("\nSections:\nname                 size(units)  address   load      align  flags")
    for s in sections:
        words = " ".join(word for flag, word in _FLAG_WORDS if s.flags & flag)
        contents = "" if s.type == c.SHT_NOBITS else "CONTENTS "
        print(f"{s.name:20} {s.units:#11x}  {s.address:08x}  {s.load:08x}  {s.align:5}  {contents}{words or 'INFO'}")


def _symbols(image: ObjectFile | Executable) -> None:
    print("\nSymbols:\naddress  class section              size     name")
    for s in image.symbols:
        if s.type == c.STT_SECTION:
            continue
        where = s.section.name if s.section else {Home.UNDEFINED: "*UND*", Home.COMMON: "*COM*"}.get(s.home, "*ABS*")
        kind = {c.STT_FUNC: "F", c.STT_OBJECT: "O"}.get(s.type, " ")
        print(f"{s.value:08x} {letter(s)} {kind}   {where:20} {s.size:08x} {s.name}")


def _relocation_text(section: Section, low: int, high: int) -> list[str]:
    """Return a line for each relocation whose field starts in octets low..high-1."""
    found = []
    for r in section.relocs:
        if low <= r.offset < high:
            kind = RELOCATIONS.get(r.type)
            name = r.symbol.name or (r.symbol.section.name if r.symbol.section else "*ABS*")
            found.append(f"{r.offset // 2:#x}: {kind.name if kind else f'type {r.type}'} {name}")
    return found


def _relocations(sections: list[Section]) -> None:
    for section in sections:
        if section.relocs:
            print(f"\nRelocations of section {section.name}:")
            print("\n".join("  " + line for line in _relocation_text(section, 0, len(section.data))))


def _disassembly(
    image: ObjectFile | Executable, sections: list[Section], source: bool, relocs: bool, start: str | None
) -> None:
    lines = lines_of(image) if source and isinstance(image, Executable) else LineTable({})
    if source and isinstance(image, Executable) and not len(lines):
        print("(no line information in this file)")
    text = SourceText()
    low, high = _range(image, start)
    for section in sections:
        if not section.is_code or not section.data or section.type != c.SHT_PROGBITS:
            continue
        names = Names(image.symbols, section if isinstance(image, ObjectFile) else None)
        shown = [i for i in items(section) if low <= i.address < high]
        if shown:
            print(f"\nDisassembly of section {section.name}:")
        previous = ""
        for item in shown:
            previous = _print_item(section, item, names, lines, text, previous, relocs)


def _range(image: ObjectFile | Executable, start: str | None) -> tuple[int, int]:
    if start is None:
        return 0, 1 << 24
    from toolchain.elf.symbols import symbol_sizes

    for symbol, size in symbol_sizes(image.symbols, relative=isinstance(image, ObjectFile)):
        if start in (symbol.name, symbol.name.removeprefix("_")):
            return symbol.value, symbol.value + size
    raise ToolError(f"no symbol is called {start}")


def _print_item(
    section: Section, item: CodeItem, names: Names, lines: LineTable, text: SourceText, previous: str, relocs: bool
) -> str:
    """Print one instruction with its label, source and relocations; return its source line."""
    symbol = names.at["code"].get(item.address)
    if symbol is not None:
        print(f"\n{item.address:08x} <{symbol.name}>:")
    line = lines.find(item.address)
    here = str(line) if line else previous
    if line and here != previous:
        content = text.line(line.file, line.line)
        print(f"; {here}" + (f"  {content.strip()}" if content is not None else ""))
    words = " ".join(f"{word:06x}" for word in item.words)
    handler = names.operand(item.words[0], "code") if section.name in VECTOR_TABLES else None
    print(f"{item.address:6x}:  {words:15} {f'.pword {handler}' if handler else text_of(item, names)}")
    if relocs:
        at = (item.address - section.address) * 2
        for found in _relocation_text(section, at, at + 4 * len(item.words)):
            print(f"{'':24}{found}")
    return here
