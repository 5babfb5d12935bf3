"""Chips as data: one folder of tables each, found by name or by the processor id of an ELF file."""

from __future__ import annotations

from importlib import import_module
from typing import Final

from emu.chips.chip import Chip

NAMES: Final = ("dsPIC30F6014A", "dsPIC30F4013")
"""Chips there are tables of, the default first."""


def chip_named(name: str = NAMES[0]) -> Chip:
    """The chip called `name`, in any case, with or without "dsPIC". Raises ValueError for one without tables."""
    wanted = name.lower().removeprefix("dspic")
    for known in NAMES:
        if known.lower().removeprefix("dspic") == wanted:
            chip: Chip = getattr(import_module(f"emu.chips.{known.lower()}"), known.upper())
            return chip
    raise ValueError(f"there is no chip {name!r}; expected one of {', '.join(NAMES)}")


def chip_of(processor: int) -> Chip | None:
    """The chip with that processor id in the flags of an ELF file (abi-elf.md §6.1), None if no table has it."""
    return next((chip for chip in map(chip_named, NAMES) if processor in chip.processors), None)
