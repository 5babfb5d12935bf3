"""What a link can be told; names and defaults follow Microchip's linker (abi-elf.md §3.3)."""

from __future__ import annotations

from dataclasses import dataclass, field

from emu.chips import chip_named
from emu.chips.chip import Chip, Region

STACK_GUARD = 16  # abi-elf.md §3.3: --stackguard default
MINIMUM_STACK = 16  # --stack default


@dataclass(frozen=True, slots=True)
class PartRegions:
    """What a program may use that another image calls: a range of program memory and one of RAM. It has no vectors, no
    reset and no stack, and its constants lie in its RAM, since the PSV window shows those of the other image."""

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
    debug_phantoms: bool = False  # DWARF bytes doubled, as XC16 stores them (abi-elf.md §6.2)
    undefined: list[str] = field(default_factory=list)
    define: dict[str, int] = field(default_factory=dict)
    chip: Chip = field(default_factory=chip_named)
    part: PartRegions | None = None
