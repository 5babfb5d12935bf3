"""A firmware image in memory: program words by address, sections, symbols and source lines.

Input: blocks and sections from a reader (`emu.image.elf`, `emu.image.hex`). Output: words for the machine's program
memory, and names and source lines for reports.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from emu.chips.chip import Chip, Region

if TYPE_CHECKING:
    from emu.image.lines import LineTable
    from emu.image.symbols import Symbol, Symbols

BYTES_PER_WORD: Final = 3
"""Flash bytes per program word, as counted in data sheets."""

ERASED: Final = 0xFFFFFF
"""Value of a program word that the file does not define (abi-elf.md §6.8 step 6)."""

LOADABLE: Final = ("flash", "eedata", "unitid", "config")
"""Regions of program space that an image may define (abi-elf.md §6.8 step 4)."""


class LoadError(ValueError):
    """The file cannot be loaded. The message says path, location, what was found and what was expected."""

    def __init__(self, path: str, message: str) -> None:
        super().__init__(f"{path}: {message}")


@dataclass(frozen=True, slots=True)
class Block:
    """Consecutive 24-bit program words, starting at the even address `base` (PC units)."""

    base: int
    words: array[int]
    origin: str
    """Section or line that the words come from, for messages."""
    is_code: bool = True
    """Whether the words are code and not constants or tables. Always True for HEX files, which do not distinguish them.
    """

    def __repr__(self) -> str:
        return f"<Block {self.origin[:80]}: {len(self.words)} words at {self.base:#08x}>"

    @property
    def end(self) -> int:
        """First address after the block."""
        return self.base + 2 * len(self.words)


@dataclass(frozen=True, slots=True)
class Section:
    """One section of an ELF file. Addresses and size are in address units: PC units, or bytes of data."""

    name: str
    kind: str
    """Kind of section: "code", "psv", "eedata", "data", "bss" or "info"."""
    address: int
    size: int
    flags: int
    load_address: int | None
    """Program address of the words; None if the section is not loaded."""
    octets: bytes
    """Raw file content (empty for bss)."""

    def __repr__(self) -> str:
        return f"<Section {self.name[:80]}: {self.kind}, {self.size} units at {self.address:#x}>"

    @property
    def program_words(self) -> int:
        """Number of program words that the section occupies, 0 if it is not loaded."""
        return 0 if self.load_address is None else -(-self.size // 2)


@dataclass(eq=False)
class Image:
    """A loaded firmware image. `blocks` are sorted and disjoint, each inside one loadable region."""

    path: str
    kind: str
    """File format: "elf" or "hex"."""
    chip: Chip
    blocks: tuple[Block, ...]
    sections: tuple[Section, ...] = ()
    raw_symbols: tuple[Symbol, ...] = ()
    entry: int | None = None
    """e_entry of an ELF file (PC units). The chip itself always starts at 0."""
    warnings: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        return f"<Image {self.path[-80:]}: {self.kind}, {self.chip.name}, {len(self.blocks)} blocks>"

    def words(self, region: Region | None = None) -> Iterator[tuple[int, int]]:
        """Yield (address, word) of every defined program word, in address order, in one region or in all."""
        for block in self.blocks:
            if region is None or block.base in region:
                yield from zip(range(block.base, block.end, 2), block.words, strict=True)

    def flash(self) -> array[int]:
        """Return the content of flash, one element per program word; undefined words are erased."""
        region = self.chip.program["flash"]
        words = array("I", [ERASED]) * (region.size // 2)
        for block in self.blocks:
            if block.base in region:
                first = (block.base - region.start) // 2
                words[first : first + len(block.words)] = block.words
        return words

    def used(self, region: Region) -> int:
        """Return the number of program words that the image defines in `region`."""
        return sum(len(block.words) for block in self.blocks if block.base in region)

    def word(self, address: int) -> int | None:
        """Return the program word at an even address, None if undefined."""
        for block in self.blocks:
            if block.base <= address < block.end:
                return block.words[(address - block.base) // 2]
        return None

    @cached_property
    def register_names(self) -> dict[int, str]:
        """Names of the bytes of special function registers, by data address."""
        names = {}
        for sfr in self.chip.sfrs.values():
            names[sfr.address] = sfr.name
            if sfr.size == 2:
                names[sfr.address + 1] = f"{sfr.name}+1"
        return names

    @cached_property
    def symbols(self) -> Symbols:
        """Symbols by name and by address; empty for HEX files."""
        from emu.image.symbols import Symbols

        return Symbols(self.raw_symbols)

    @cached_property
    def lines(self) -> LineTable:
        """Source lines by program address; empty if the image has no DWARF or it cannot be read."""
        from emu.image.lines import LineTable

        return LineTable({section.name: section.octets for section in self.sections if section.kind == "info"})


def check_blocks(path: str, chip: Chip, blocks: list[Block]) -> tuple[Block, ...]:
    """Return the blocks in address order. Raises LoadError if two overlap or one is not within program memory."""
    regions = [chip.program[name] for name in LOADABLE]
    blocks = sorted(blocks, key=lambda block: block.base)
    for block in blocks:
        home = next((region for region in regions if block.base in region), None)
        if home is None or block.end > home.end:
            outside = block.base if home is None else home.end
            raise LoadError(
                path,
                f"{block.origin} puts words at {outside:#08x}, where the {chip.name} has no program memory"
                f" (flash ends at {chip.program['flash'].end:#x})",
            )
    for first, second in pairwise(blocks):
        if second.base < first.end:
            raise LoadError(path, f"{first.origin} and {second.origin} overlap at {second.base:#08x}")
    return tuple(blocks)
