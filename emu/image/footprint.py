"""Static memory use of an image: the symbol and source file of every ROM word and RAM byte.

Input: an image, preferably with symbols and DWARF. Output: `Piece`s whose sizes add up to the totals of `emu info`. A
piece without a symbol has its section's name; a piece without a source file has `UNKNOWN`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from emu.image.model import BYTES_PER_WORD, Image, Section
from emu.image.symbols import Symbol

UNKNOWN: Final = "(no source)"
START_UP: Final = frozenset(
    ("__reset", "__resetPRI", "__resetALT", "__psv_init", "__data_init", "_exit", "__Exit", "__exit_status")
)
"""Names of the symbols of crt0 (abi-elf.md §3.1) and of exit."""
START_UP_SECTIONS: Final = frozenset((".reset", ".dinit", ".init"))
PRINTF: Final = ("printf", "_format", "putchar", "_puts", "__fout")
"""Substrings of symbols that belong to formatted output."""


@dataclass(frozen=True, slots=True)
class Piece:
    """`rom` bytes of flash or `ram` bytes of data memory of one symbol. `kind` is code, const, table or data."""

    name: str
    module: str
    kind: str
    rom: int
    ram: int


def pieces(image: Image) -> list[Piece]:
    """Return all pieces of flash and RAM of the image, largest first."""
    found: list[Piece] = []
    flash = image.chip.program["flash"]
    for section in image.sections:
        if section.load_address is not None and section.load_address in flash:
            found += _program_pieces(image, section)
        elif section.kind in ("data", "bss") and section.size:
            found += _data_pieces(image, section)
    return sorted(found, key=lambda piece: (-piece.rom - piece.ram, piece.name))


def group(piece: Piece) -> str:
    """Return the group of a piece: "start-up", "printf", "vectors" or "program"."""
    if piece.name in START_UP or piece.name in START_UP_SECTIONS or "crt0" in piece.module:
        return "start-up"
    if piece.name in (".ivt", ".aivt"):
        return "vectors"
    if any(part in piece.name for part in PRINTF) or "printf" in piece.module:
        return "printf"
    return "program"


def totals(items: Iterable[Piece], key: str) -> dict[str, tuple[int, int]]:
    """Return (ROM, RAM) bytes by `key` ("module", "kind", "name" or "group"), largest first."""
    rom: Counter[str] = Counter()
    ram: Counter[str] = Counter()
    for piece in items:
        label = group(piece) if key == "group" else getattr(piece, key)
        rom[label] += piece.rom
        ram[label] += piece.ram
    return {
        label: (rom[label], ram[label]) for label in sorted(rom, key=lambda label: (-rom[label] - ram[label], label))
    }


def _program_pieces(image: Image, section: Section) -> list[Piece]:
    """Split a loaded section at its symbols, and its code also at changes of source file."""
    assert section.load_address is not None
    space = {"code": "code", "psv": "psv"}.get(section.kind, "")
    kind = {"code": "code", "psv": "const"}.get(section.kind, "table")
    words: Counter[tuple[str, str]] = Counter()
    for symbol, start, end in _cuts(image, section, space):
        named = start + symbol.size if symbol and symbol.size and kind == "const" else end
        shift = section.load_address - section.address
        # Constants may begin at odd addresses. A word belongs to the symbol of its first byte.
        first = start + start % 2
        for address in range(first + shift, end + shift, 2):
            line = image.lines.find(address) if kind == "code" else None
            is_named = symbol is not None and address - shift < named  # unnamed strings may follow a named constant
            file = line.file if line else image.lines.files.get(start, UNKNOWN) if is_named else UNKNOWN
            words[symbol.name if symbol and is_named else section.name, file] += 1
    if section.name in START_UP_SECTIONS or section.name in (".ivt", ".aivt"):
        kind = "table"
    return [Piece(name, module, kind, BYTES_PER_WORD * count, 0) for (name, module), count in words.items()]


def _data_pieces(image: Image, section: Section) -> list[Piece]:
    """Split a RAM section at its symbols. Bytes without a symbol get the section's name."""
    found = []
    for symbol, start, end in _cuts(image, section, "data"):
        named = min(end - start, symbol.size or end - start) if symbol else 0
        if symbol and named:
            found.append(Piece(symbol.name, image.lines.files.get(start, UNKNOWN), "data", 0, named))
        if end - start > named:
            found.append(Piece(section.name, UNKNOWN, "data", 0, end - start - named))
    return found


def _cuts(image: Image, section: Section, space: str) -> list[tuple[Symbol | None, int, int]]:
    """Return (symbol, start, end) of each range of a section, in its own addresses.

    The first range may lack a symbol.
    """
    end = section.address + section.size
    names: dict[int, Symbol] = {}
    for symbol in image.symbols.all:
        inside = symbol.space == space and section.address <= symbol.address < end
        if inside and symbol.names_content and (symbol.address not in names or symbol.kind != "label"):
            names[symbol.address] = symbol
    starts = sorted({section.address, *names})
    return [(names.get(start), start, stop) for start, stop in zip(starts, [*starts[1:], end], strict=True)]
