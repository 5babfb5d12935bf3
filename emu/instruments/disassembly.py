"""Disassembly of an image's program words, with symbols as operands.

Input: an image. Output: `Item`s in address order, for `emu disasm`, traces and fault reports.
"""

from __future__ import annotations

from collections.abc import Iterator

from emu.debug.disassembly import Item, instruction
from emu.image.model import Block, Image


def items(image: Image, start: int, end: int) -> Iterator[Item]:
    """Yield all items defined by the image in flash, from `start` up to `end`."""
    flash = image.chip.program["flash"]
    vectors = {table: vector.name for vector in image.chip.vectors for table in (vector.ivt, vector.aivt)}
    for block in image.blocks:
        if block.base not in flash:
            continue
        address = max(block.base, start + start % 2)
        while address < min(block.end, end):
            item = _item(image, block, address, vectors)
            yield item
            address += 2 * len(item.words)


def _item(image: Image, block: Block, address: int, vectors: dict[int, str]) -> Item:
    """Return the item at `address`, which is in `block`."""
    index = (address - block.base) // 2
    word = block.words[index]
    if address in vectors:
        return Item(address, (word,), f".pword {word:#08x} ; {vectors[address]} -> {image.symbols.text(word)}")
    if block.is_code:
        second = block.words[index + 1] if index + 1 < len(block.words) else 0
        found = instruction(image, address, word, second)
        if found is not None and index + len(found.words) <= len(block.words):
            return found
    return Item(address, (word,), f".pword {word:#08x}")
