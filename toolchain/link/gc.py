"""--gc-sections: selection of the input sections that are reachable from the roots."""

from __future__ import annotations

import re

from emu.chips.family import SLOTS
from emu.image.elf_facts import SectionFlag
from toolchain.asm.finish import KEEP_PREFIX
from toolchain.elf.model import Home, Section
from toolchain.link.memory import CONFIG_SECTIONS
from toolchain.link.resolve import Resolution

SECTION_LIMIT = re.compile(r"\.(startof|sizeof|endof)\.(.+)")
"""Pattern of the symbols for `.startof.(section)`, `.sizeof.(section)` and `.endof.(section)` (abi-elf.md §4.2)."""

ROOT_NAMES = frozenset((".reset", ".init", ".user_init", ".ivt", ".aivt"))


def vector_names() -> set[str]:
    """Return the symbols that are entered in the vector tables if they are defined (abi-elf.md §2.7)."""
    names = {"__DefaultInterrupt"}
    for vector in SLOTS:
        names |= {vector.symbol, vector.alternate_symbol}
    return names


def _roots(resolution: Resolution, names: list[str]) -> list[Section]:
    roots: list[Section] = []
    for obj in resolution.objects:
        kept = {s.name.removeprefix(KEEP_PREFIX) for s in obj.symbols if s.name.startswith(KEEP_PREFIX)}
        for section in obj.sections:
            always = section.name in ROOT_NAMES or section.name in CONFIG_SECTIONS or section.name in kept
            fixed = section.flags & (SectionFlag.ABSOLUTE | SectionFlag.EEDATA) and section.units
            if always or fixed or not section.flags & SectionFlag.ALLOC:
                roots.append(section)
    for name in names:
        symbol = resolution.globals.get(name)
        if symbol is not None and symbol.section is not None:
            roots.append(symbol.section)
    return roots


def live_sections(resolution: Resolution, names: list[str], collect: bool) -> set[Section]:
    """Return the sections to link: all of them, or with `collect` those reachable from `names` and the fixed roots."""
    if not collect:
        return set(resolution.owner)
    by_name: dict[str, list[Section]] = {}
    for section in resolution.owner:
        by_name.setdefault(section.name, []).append(section)
    live: set[Section] = set()
    work = _roots(resolution, names)
    while work:
        section = work.pop()
        if section in live:
            continue
        live.add(section)
        if not section.flags & SectionFlag.ALLOC:
            continue  # references from debug information keep no section
        for reloc in section.relocs:
            target = resolution.lookup(reloc.symbol)
            if target.home is Home.SECTION and target.section is not None and target.section not in live:
                work.append(target.section)
            elif limit := SECTION_LIMIT.fullmatch(reloc.symbol.name):
                work += by_name.get(limit[2], [])
    return live
