"""Disassembly of sections, with symbol names.

It decodes by the table of `emu.dspic30f.isa`. `objdump` and the stack and time analyses use it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from emu.dspic30f.isa import codec, text
from emu.dspic30f.isa.row import Insn
from emu.image.elf_facts import OCTETS_PER_WORD, UNITS_PER_WORD
from toolchain.elf import constants as c
from toolchain.elf.model import Bind, Home, Section, Symbol
from toolchain.elf.symbols import is_named

NO_INSTRUCTIONS = frozenset((".ivt", ".aivt", ".dinit"))
"""Sections that have code flags but contain tables, not instructions (abi-elf.md §6.3)."""


@dataclass(frozen=True, slots=True)
class CodeItem:
    """One instruction (one or two words) at `address`; `insn` is None for a word that is no instruction."""

    address: int
    words: tuple[int, ...]
    insn: Insn | None


class Names:
    """Lookup of the nearest symbol at or below an address, in code and in data."""

    def __init__(self, symbols: Iterable[Symbol], section: Section | None = None) -> None:
        """Index the symbols; with `section`, only those of that section, with section-relative values as in objects."""
        best: dict[str, dict[int, Symbol]] = {"code": {}, "data": {}}
        for symbol in symbols:
            if not is_named(symbol) or symbol.home is Home.UNDEFINED:
                continue
            if section is not None and symbol.section is not section:
                continue
            code = symbol.section is not None and symbol.section.is_code
            space = best["code" if code else "data"]
            if symbol.value not in space or _better(symbol, space[symbol.value]):
                space[symbol.value] = symbol
        self.at = best
        self._order = {space: sorted(table) for space, table in best.items()}

    def find(self, address: int, space: str) -> tuple[Symbol, int] | None:
        """Return (symbol, distance) for an address; None if no symbol is below it or the nearest one ends before it."""
        order = self._order[space]
        index = bisect_right(order, address) - 1
        if index < 0:
            return None
        symbol = self.at[space][order[index]]
        distance = address - symbol.value
        if distance and symbol.size and distance >= symbol.size:
            return None
        if space == "data" and distance and not symbol.size:
            return None
        return symbol, distance

    def operand(self, address: int, space: str) -> str | None:
        """Return an address as operand text, `0x10c <_main+0x4>`; None without a symbol."""
        found = self.find(address, space)
        if found is None:
            return None
        symbol, distance = found
        return f"{address:#x} <{symbol.name}{f'+{distance:#x}' if distance else ''}>"


def _better(new: Symbol, old: Symbol) -> bool:
    """Whether `new` is the preferred name of two at one address: functions first, then globals (abi-elf.md §6.5)."""
    return (new.type == c.STT_FUNC, new.bind is not Bind.LOCAL) > (old.type == c.STT_FUNC, old.bind is not Bind.LOCAL)


def items(section: Section) -> Iterator[CodeItem]:
    """Yield the items of a code section in order."""
    words = [int.from_bytes(section.data[i : i + 3], "little") for i in range(0, len(section.data), OCTETS_PER_WORD)]
    index = 0
    plain = section.name in NO_INSTRUCTIONS
    while index < len(words):
        address = section.address + index * UNITS_PER_WORD
        following = words[index + 1] if index + 1 < len(words) else None
        insn = None if plain else codec.decode(words[index], following or 0)
        length = insn.words if insn is not None else 1
        if length == 2 and following is None:
            insn, length = None, 1
        yield CodeItem(address, tuple(words[index : index + length]), insn)
        index += length


def text_of(item: CodeItem, names: Names | None = None) -> str:
    """Return the assembly text of an item."""
    if item.insn is None:
        return f".pword {item.words[0]:#08x}"
    return text.format(item.insn, item.address, names.operand if names else None)
