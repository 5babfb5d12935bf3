"""Programs for running robots (firmware/openswarm/io/update): checks of the image, its rows and CRC."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Final

from emu.chips.chip import Region
from emu.image.model import ERASED, Image
from openswarm.flashing.loaders import ROW_BYTES, ROW_UNITS, ROW_WORDS

SLOT: Final = Region("slot of programs", 0x00F800, 0x010000)
"""Run slot in program memory, in PC units (board/epuck/update/update_slots.h)."""
RAM: Final = Region("RAM of programs", 0x0800, 0x0A00)
"""RAM of a program, in bytes (board/epuck/update/update_slots.h)."""
ROWS: Final = SLOT.size // ROW_UNITS
VERSION_SYMBOL: Final = "__update_version"
"""Absolute symbol in the image of a program that holds its version."""
LAST_VERSION: Final = 0xFFFF


@dataclass(frozen=True, slots=True)
class Program:
    """A program in the form in which robots transfer it."""

    version: int
    rows: tuple[bytes, ...]
    """Rows of ROW_BYTES each."""
    unused: int = 0
    """Number of bytes at the end of the last row that the program does not use."""

    @property
    def crc(self) -> int:
        """CRC-32 (IEEE 802.3) of all rows."""
        return zlib.crc32(b"".join(self.rows))


def is_program(image: Image) -> bool:
    """Whether an image is a program: it has words in the run slot and none at the reset vector."""
    return image.word(0) is None and image.used(SLOT) > 0


def program_of(image: Image) -> Program:
    """Return the program of an image. Raises ValueError for an image that robots cannot receive."""
    version = image.symbols.find(VERSION_SYMBOL)
    if version is None:
        raise ValueError(f"{image.path}: has no {VERSION_SYMBOL}: expected the ELF file that `openswarm program` made")
    if not 1 <= version.address <= LAST_VERSION:
        raise ValueError(f"{image.path}: is of version {version.address}; expected 1 to {LAST_VERSION}")
    if image.word(SLOT.start) is None:
        raise ValueError(f"{image.path}: has nothing at {SLOT.start:#08x}, where programs begin")
    outside = [block for block in image.blocks if block.base < SLOT.start or block.end > SLOT.end]
    if outside:
        raise ValueError(
            f"{image.path}: {outside[0].origin} has words at {outside[0].base:#08x}, outside of the slot of programs,"
            f" {SLOT.start:#08x} to {SLOT.end - 2:#08x}"
        )
    end = max(block.end for block in image.blocks)
    words = [image.word(address) for address in range(SLOT.start, end, 2)]
    unused = 3 * (-len(words) % ROW_WORDS)
    words += [None] * (unused // 3)
    data = b"".join((ERASED if word is None else word).to_bytes(3, "little") for word in words)
    rows = tuple(data[at : at + ROW_BYTES] for at in range(0, len(data), ROW_BYTES))
    return Program(version.address, rows, unused)
