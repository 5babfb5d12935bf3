"""Chips as data: one folder of tables each. Chips are found by name or by the processor id of an ELF file."""

from __future__ import annotations

from importlib import import_module
from typing import Final

from emu.chips.chip import Chip

NAMES: Final = ("dsPIC30F6014A", "dsPIC30F4013", "dsPIC30F3014", "dsPIC30F4011", "dsPIC30F6012A", "dsPIC30F6014")
"""Supported chips, the default first."""


def chip_named(name: str = NAMES[0]) -> Chip:
    """Return the chip called `name`, in upper or lower case, with or without "dsPIC". Raises ValueError if unknown."""
    wanted = name.lower().removeprefix("dspic")
    for known in NAMES:
        if known.lower().removeprefix("dspic") == wanted:
            chip: Chip = getattr(import_module(f"emu.chips.{known.lower()}"), known.upper())
            return chip
    raise ValueError(f"unknown chip {name!r}; expected one of {', '.join(NAMES)}")


def chip_of(processor: int) -> Chip | None:
    """Return the chip with the given processor id of an ELF file's flags (abi-elf.md §6.1), None if unknown."""
    return next((chip for chip in map(chip_named, NAMES) if processor in chip.processors), None)
