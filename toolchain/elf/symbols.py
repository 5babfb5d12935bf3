"""Queries on symbol tables that several tools use."""

from __future__ import annotations

from collections.abc import Iterable

from toolchain.elf import constants as c
from toolchain.elf.model import Section, Symbol

_COMPILER_LABELS = (".L", "L0", "___PA___", "___BP___")  # prefixes of labels that compilers generate (abi-elf.md §6.5)


def is_named(symbol: Symbol) -> bool:
    """Whether a symbol is named in the source, unlike a label that the compiler generated."""
    return (
        bool(symbol.name)
        and symbol.type not in (c.STT_SECTION, c.STT_FILE)
        and not symbol.name.startswith(_COMPILER_LABELS)
    )


def symbol_sizes(symbols: Iterable[Symbol], relative: bool = True) -> list[tuple[Symbol, int]]:
    """Return (symbol, size in address units) for named symbols in sections, by section and value.

    A symbol without a recorded size, as in library assembly (abi-elf.md §6.5), extends to the next symbol or to the end
    of its section.  `relative`: values count from the section start, as in objects.
    """
    by_section: dict[Section, list[Symbol]] = {}
    for symbol in symbols:
        if symbol.section is not None and is_named(symbol):
            by_section.setdefault(symbol.section, []).append(symbol)
    result: list[tuple[Symbol, int]] = []
    for section, members in by_section.items():
        members.sort(key=lambda s: (s.value, s.name))
        end = section.units + (0 if relative else section.address)
        for index, symbol in enumerate(members):
            following = next((m.value for m in members[index + 1 :] if m.value > symbol.value), end)
            result.append((symbol, symbol.size or max(following - symbol.value, 0)))
    return result
