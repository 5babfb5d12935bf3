"""Options of a link; names and defaults follow Microchip's linker (abi-elf.md §3.3)."""

from __future__ import annotations

from dataclasses import dataclass, field

from emu.chips import chip_named
from emu.chips.chip import Chip, Region

STACK_GUARD = 16  # default of --stackguard in bytes (abi-elf.md §3.3)
MINIMUM_STACK = 16  # default of --stack in bytes


@dataclass(frozen=True, slots=True)
class PartRegions:
    """Memory of a program that another image calls (`--part`): a range of program memory and one of RAM.

    Such a program has no vectors, reset and stack.  Its constants are in its RAM, because the PSV window shows the
    constants of the other image.
    """

    program: Region
    data: Region


@dataclass(slots=True)
class LinkOptions:
    """Options of one link."""

    entry: str = "__reset"
    gc_sections: bool = False
    heap: int = 0
    stack: int = MINIMUM_STACK
    stack_guard: int = STACK_GUARD
    data_init: bool = True
    pack_data: bool = True
    handles: bool = True
    isr: bool = True
    fill_upper: int = 0
    debug_phantoms: bool = False  # store each DWARF byte followed by a phantom octet, as XC16 does (abi-elf.md §6.2)
    undefined: list[str] = field(default_factory=list)
    define: dict[str, int] = field(default_factory=dict)
    chip: Chip = field(default_factory=chip_named)
    part: PartRegions | None = None
