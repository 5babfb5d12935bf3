"""Output sections and symbols of the executable, from placed and relocated input sections (abi-elf.md §6)."""

from __future__ import annotations

from dataclasses import dataclass

from emu.image.elf_facts import OCTETS_PER_WORD, Content, SectionFlag, content_kind
from toolchain.elf import constants as c
from toolchain.elf.model import Bind, Executable, Home, Section, Symbol
from toolchain.elf.symbols import is_named
from toolchain.link.place import Layout, is_const, space_of
from toolchain.link.relocate import Relocator
from toolchain.link.resolve import Resolution

F = SectionFlag
_KEPT = (
    F.WRITE | F.ALLOC | F.EXECINSTR | F.NOLOAD | F.NEAR | F.PERSIST | F.XMEM | F.YMEM | F.PSV | F.EEDATA | F.ABSOLUTE
)
_OWN_NAME = (".reset", ".ivt", ".aivt", ".handle", ".dinit")
"""Sections that keep their name, unlike Microchip's `.handle` (functions whose address is taken), which is in .text."""


@dataclass(slots=True)
class Output:
    """One section of the executable, and its input sections in order."""

    section: Section
    inputs: list[Section]


def _name(section: Section) -> str:
    """Return the output name of an input section: its class (abi-elf.md §1.4), or its own name if fixed."""
    if space_of(section) == "config":
        return section.name.removesuffix(".sec")
    if section.flags & F.ABSOLUTE or section.name in _OWN_NAME or not section.flags & F.ALLOC:
        return section.name
    if section.is_code:
        return ".text"
    if section.is_psv:
        return ".const" if is_const(section) else section.name
    if section.is_eedata:
        return ".eedata"
    if section.flags & F.PERSIST:
        return ".pbss"
    stem = "bss" if section.type == c.SHT_NOBITS else "data"
    return (
        ".n" if section.flags & F.NEAR else ".y" if section.flags & F.YMEM else ".x" if section.flags & F.XMEM else "."
    ) + stem


def _flags(section: Section) -> int:
    flags = section.flags & _KEPT
    if section.is_ram and section.type != c.SHT_NOBITS:
        # The contents are in .dinit. Without this flag, bin2hex overwrites program words with them (§7 item 4).
        flags |= F.NOLOAD
    if section.is_psv or section.is_eedata:
        flags &= ~(F.EXECINSTR | F.ABSOLUTE)
    return flags


def _content(section: Section, octets: bytearray, size: int, fill_upper: int) -> bytearray:
    """Return the octets of an input section in the executable's layout, padded to `size` units (abi-elf.md §6.2)."""
    if section.type == c.SHT_NOBITS:
        return bytearray()
    padded = octets + bytes(size * 2 - len(octets))
    if content_kind(section.flags, executable=True) is not Content.PAIRS:
        return padded
    result = bytearray(len(padded))
    result[0::OCTETS_PER_WORD] = padded[0::OCTETS_PER_WORD]
    result[1::OCTETS_PER_WORD] = padded[2::OCTETS_PER_WORD]
    if section.is_psv:
        result[2::OCTETS_PER_WORD] = bytes((fill_upper,)) * (len(result) // OCTETS_PER_WORD)
    return result


def build_outputs(
    layout: Layout, contents: dict[Section, bytearray], fill_upper: int, debug_phantoms: bool
) -> list[Output]:
    """Join adjacent input sections of the same kind, in the order program, constants, data, debug.

    Phantom octets of debug sections are removed, so that any DWARF reader can read the image. `debug_phantoms`
    keeps them, as in XC16's images.
    """
    rank = {"program": 0, "config": 1, "eeprom": 2, "data": 3, "info": 4}

    def order(section: Section) -> tuple[int, str, int]:
        space = space_of(section)
        return rank[space], section.name if space == "info" else "", layout.placed[section].load

    outputs: list[Output] = []
    for section in sorted((s for s, p in layout.placed.items() if p.size), key=order):
        placed, name, flags = layout.placed[section], _name(section), _flags(section)
        content = _content(section, contents[section], placed.size, fill_upper)
        last = outputs[-1].section if outputs else None
        joined = (
            last is not None
            and (last.name, last.flags, last.type) == (name, flags, section.type)
            and last.load + last.units == placed.load
        )
        if last is None or not joined:
            last = Section(name, flags, section.type, address=placed.address, load=placed.load)
            last.align = 2 if flags & F.ALLOC else 1
            outputs.append(Output(last, []))
        outputs[-1].inputs.append(section)
        if section.type == c.SHT_NOBITS:
            last.nobits_units += placed.size
        else:
            last.data += content
    if not debug_phantoms:
        for section in (output.section for output in outputs if output.section.name.startswith(".debug_")):
            section.type, section.data = c.SHT_PROGBITS, section.data[::2]
    return outputs


def build_executable(
    resolution: Resolution, outputs: list[Output], relocator: Relocator, entry: int, processor: int
) -> Executable:
    """Return the executable with its symbols: named symbols of the objects, and referenced linker symbols."""
    home = {section: output.section for output in outputs for section in output.inputs}
    symbols: list[Symbol] = []
    for obj in resolution.objects:
        for symbol in obj.symbols:
            if not is_named(symbol):
                continue
            if symbol.bind is not Bind.LOCAL and resolution.globals.get(symbol.name) is not symbol:
                continue
            target = relocator.target(symbol)
            if symbol.home is Home.SECTION and symbol.section in home and symbol.section.flags & F.ALLOC:
                placed = Symbol(symbol.name, Home.SECTION, home[symbol.section], target.address, symbol.size)
            elif symbol.home is Home.ABSOLUTE and symbol.bind is not Bind.LOCAL:
                placed = Symbol(symbol.name, Home.ABSOLUTE, None, target.address, symbol.size)
            else:
                continue
            placed.bind, placed.type, placed.visibility = symbol.bind, symbol.type, symbol.visibility
            symbols.append(placed)
    for name, value in relocator.absolute.items():
        if name in resolution.wanted and name not in resolution.globals:
            symbols.append(Symbol(name, Home.ABSOLUTE, None, value, bind=Bind.GLOBAL))
    return Executable([o.section for o in outputs], symbols, entry, processor)
