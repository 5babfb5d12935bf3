"""Memory regions of a chip and symbols of its linker script, from `emu.chips`; allocation of free intervals."""

from __future__ import annotations

from bisect import insort
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

from emu.chips import NAMES, chip_named
from emu.chips.chip import Chip, Region
from emu.chips.family import UNIT_ID
from emu.image.elf_facts import UNITS_PER_WORD
from toolchain.link.options import PartRegions

HANDLE_LIMIT = 0x10000  # first address that a function pointer of 16 bits cannot hold (abi-elf.md §1.5)
UNIT_ID_WORDS = 4  # number of unit-id words, FUID0..3 (abi-elf.md §3.3)


class ChipMemory:
    """Memory regions of a chip, or of the part of it that `--part` selects."""

    def __init__(self, chip: Chip, part: PartRegions | None = None) -> None:
        self.chip: Final = chip
        program, data = chip.program, chip.data
        self.flash, self.program, self.eeprom = program["flash"], program["program"], program["eedata"]
        self.reset, self.ivt, self.aivt = program["reset"], program["ivt"], program["aivt"]
        self.ram, self.near, self.x_ram, self.y_ram = data["ram"], data["near"], data["xram"], data["yram"]
        if part is not None:
            self.program, self.ram = part.program, part.data
            self.near, self.x_ram, self.y_ram = (_common(r, part.data) for r in (self.near, self.x_ram, self.y_ram))

    @cached_property
    def config_sections(self) -> Mapping[str, int]:
        """Program addresses of the configuration and unit-id words by input section name (abi-elf.md §6.6)."""
        places = {f"__{name}.sec": word.address for name, word in self.chip.config.items()}
        for index in range(UNIT_ID_WORDS):
            places[f"__FUID{index}.sec"] = UNIT_ID.start + index * UNITS_PER_WORD
        return places

    def script_symbols(self) -> dict[str, int]:
        """Absolute symbols of a device's linker script (abi-elf.md §3.3): bases, config words, SFRs in two cases."""
        symbols = {
            "__CODE_BASE": self.program.start,
            "__IVT_BASE": self.ivt.start,
            "__AIVT_BASE": self.aivt.start,
            "__DATA_BASE": self.ram.start,
            "__DATA_LENGTH": self.ram.size,
            "__YDATA_BASE": self.y_ram.start,
        }
        for name, word in self.chip.config.items():
            symbols[f"__{name}"] = word.address
        for name, sfr in self.chip.sfrs.items():
            symbols[name] = symbols[f"_{name}"] = symbols[f"_{name}bits"] = sfr.address
        for accumulator in ("ACCA", "ACCB"):  # three registers each; `PUSH ACCA` refers to the lowest (abi-elf.md §3.3)
            symbols[accumulator] = symbols[f"_{accumulator}"] = self.chip.sfrs[f"{accumulator}L"].address
        return symbols


def _common(region: Region, other: Region) -> Region:
    """Return the intersection of two regions."""
    start = max(region.start, other.start)
    return Region(region.name, start, max(start, min(region.end, other.end)))


CONFIG_SECTIONS: Final = frozenset(name for chip in map(chip_named, NAMES) for name in ChipMemory(chip).config_sections)
"""Names of the sections with configuration words, of all chips."""


@dataclass(slots=True)
class Pool:
    """Free intervals of one space, in address units, sorted; allocation is first fit and deterministic."""

    start: int
    end: int
    free: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.free = [(self.start, self.end)]

    def reserve(self, start: int, size: int) -> bool:
        """Allocate exactly [start, start + size); return False if part of it is allocated or outside."""
        for index, (low, high) in enumerate(self.free):
            if low <= start and start + size <= high:
                self._cut(index, start, size)
                return True
        return size == 0 and self.start <= start <= self.end

    def allocate(self, size: int, align: int, low: int, high: int, window: int = 0) -> int | None:
        """Allocate `size` units at the lowest fitting address in [low, high), not across multiples of `window`."""
        for index, (begin, end) in enumerate(self.free):
            at = self._fit(max(begin, low), min(end, high), size, align, window)
            if at is not None:
                self._cut(index, at, size)
                return at
        return None

    def allocate_top(self, size: int, align: int, low: int, high: int, reverse: bool = False) -> int | None:
        """Allocate at the highest fitting address; `reverse` aligns the end instead of the start."""
        for index in range(len(self.free) - 1, -1, -1):
            begin, end = max(self.free[index][0], low), min(self.free[index][1], high)
            at = end // align * align - size if reverse else (end - size) // align * align
            if at >= begin and size <= end - begin:
                self._cut(index, at, size)
                return at
        return None

    @staticmethod
    def _fit(begin: int, end: int, size: int, align: int, window: int) -> int | None:
        at = -(-begin // align) * align
        if window and size and at // window != (at + size - 1) // window:
            at = -(-(-(-at // window) * window) // align) * align
        return at if at + size <= end else None

    def _cut(self, index: int, start: int, size: int) -> None:
        low, high = self.free.pop(index)
        if low < start:
            insort(self.free, (low, start))
        if start + size < high:
            insort(self.free, (start + size, high))

    def room(self, low: int, high: int) -> int:
        """Return the free units within [low, high)."""
        return sum(max(0, min(e, high) - max(b, low)) for b, e in self.free)

    def largest(self) -> tuple[int, int]:
        """Return the largest free interval, (0, 0) if nothing is free."""
        return max(self.free, key=lambda piece: piece[1] - piece[0], default=(0, 0))
