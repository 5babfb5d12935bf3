"""Selection and order of the flash rows that are written for an image. The order keeps the boot loader reachable."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from typing import Final

from emu.image.model import ERASED, Image
from openswarm.flashing.loaders import LOADERS, ROW_UNITS, ROW_WORDS, Loader

_GOTO: Final = 0x04
"""Upper byte of the first word of GOTO; the second word 0x0000HH holds the target's upper bits (dspic30f6014a.md)."""
_ENTRY_WORDS: Final = 4

Row = tuple[int, list[int]]
"""A row of flash: its program address and its `ROW_WORDS` words."""


def goto(target: int) -> list[int]:
    """Return the two words of GOTO."""
    return [_GOTO << 16 | target & 0xFFFE, target >> 16]


def checked(image: Image) -> None:
    """Raise ValueError if no boot loader can start the image, or if none is known for its chip."""
    if not all(loader.start in image.chip.program["flash"] for loader in LOADERS.values()):
        raise ValueError(f"{image.path}: is for the {image.chip.name}, for which no boot loader is known")
    first, second = image.word(0), image.word(2)
    if first is None or second is None or first >> 16 != _GOTO or second > 0x7F:
        raise ValueError(f"{image.path}: has no GOTO at its reset vector, so that a boot loader could not start it")
    target = second << 16 | first & 0xFFFF
    if target % 2 != 0 or image.word(target) is None or target not in image.chip.program["flash"]:
        raise ValueError(
            f"{image.path}: the GOTO at its reset vector leads to {target:#08x}, where the image has no program"
        )


def rows(image: Image, loader: Loader, further: Sequence[Row] = ()) -> list[Row]:
    """Return the rows to write, in order. Raises ValueError if the image has words at the loader's addresses.

    `further` rows are outside of the image, such as the key of the swarm. Raises ValueError if they do not begin with a
    row of flash, or are the loader's or the image's own.

    1. The entry's row without the GOTO. Its four erased words are NOPs that lead into the loader, so that a robot whose
    transfer is interrupted waits in its loader at every start.

    2. All other rows; the reset vector is a GOTO to the loader.

    3. The complete row of the entry.
    """
    checked(image)
    flash = image.chip.program["flash"]
    for address, word in image.words(flash):
        if address >= loader.entry and word != ERASED:
            raise ValueError(
                f"{image.path}: has words at {address:#08x}, where the robot's boot loader ({loader.name}) is:"
                f" {loader.entry:#08x} and up are its own"
            )
    for address, _ in further:
        if address % ROW_UNITS or address not in flash or address >= loader.entry_row:
            raise ValueError(f"{image.path}: {address:#08x} is no row of flash below the boot loader")
        if any(image.word(place) is not None for place in range(address, address + ROW_UNITS, 2)):
            raise ValueError(f"{image.path}: has words at {address:#08x}, where the key of the swarm is kept")
    words = image.flash()
    entry = words[:2].tolist()
    words[:2] = array("I", goto(loader.start))
    first = loader.entry // 2
    words[first : first + _ENTRY_WORDS] = array("I", [ERASED] * _ENTRY_WORDS)

    def row(address: int) -> Row:
        return address, words[address // 2 : address // 2 + ROW_WORDS].tolist()

    used = {address // ROW_UNITS * ROW_UNITS for address, _ in image.words(flash)} - {loader.entry_row}
    order = [row(loader.entry_row), *(row(address) for address in sorted(used) if address < loader.start)]
    words[first : first + 2] = array("I", entry)
    return [*order, *further, row(loader.entry_row)]


def unwritten_parts(image: Image) -> Iterator[str]:
    """Yield descriptions of parts of an image that a boot loader does not write."""
    for name, text in (("config", "configuration words"), ("eedata", "words of data EEPROM"), ("unitid", "ID words")):
        count = image.used(image.chip.program[name])
        if count:
            yield f"{count} {text}"
