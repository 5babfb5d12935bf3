"""Whether the words of a HEX file fit a chip: the file does not name the chip for which it was built.

Input: chip and words. Output: warnings about configuration words and vectors that cannot work on the chip.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from emu.chips.chip import Chip

_ERASED: Final = 0xFFFF
_GOTO: Final = 0x040000
_GOTO_MASK: Final = 0xFF0001
_SHOWN: Final = 3
"""Maximum number of vectors that are listed."""


def misfits(chip: Chip, words: Mapping[int, int]) -> Iterator[str]:
    """Yield a sentence for each configuration word or group of vectors in `words`, by address, that does not fit."""
    yield from _configuration(chip, words)
    yield from _vectors(chip, words)


def _configuration(chip: Chip, words: Mapping[int, int]) -> Iterator[str]:
    region, known = chip.program["config"], {word.address: word for word in chip.config.values()}
    for address in range(region.start, region.end, 2):
        value = words.get(address, _ERASED) & _ERASED
        if value == _ERASED:
            continue
        if address not in known:
            yield f"configuration word {value:#06x} at {address:#08x}: the {chip.name} has none there"
        elif known[address].name == "FOSC" and not chip.clock.is_valid(
            known[address].field(value, "FOS"), known[address].field(value, "FPR")
        ):
            yield f"configuration word FOSC = {value:#06x} selects no clock mode of the {chip.name}"


def _vectors(chip: Chip, words: Mapping[int, int]) -> Iterator[str]:
    flash = chip.program["flash"]
    if words.get(0, 0) & _GOTO_MASK == _GOTO:
        target = words[0] & 0xFFFF | (words.get(2, 0) & 0x7F) << 16
        if target not in flash or target not in words:
            yield f"the reset vector jumps to {target:#08x}, where the file has no code"
    wrong = [
        f"{vector.name} ({words[vector.ivt]:#08x})"
        for vector in chip.vectors
        if vector.ivt in words and not _is_target(chip, words, words[vector.ivt])
    ]
    if wrong:
        more = f" and {len(wrong) - _SHOWN} more" if len(wrong) > _SHOWN else ""
        yield f"vectors point to addresses without code: {', '.join(wrong[:_SHOWN])}{more}"


def _is_target(chip: Chip, words: Mapping[int, int], target: int) -> bool:
    """Whether a vector may hold `target`: erased, 0, or the address of a word of the file in flash."""
    return target in (0, 0xFFFFFF) or (target in chip.program["flash"] and target in words)
