"""Disassembly of an image's program words, with symbols as operands.

Input: an image. Output: `Item`s in address order, for `emu disasm`, traces and fault reports.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from emu.dspic30f.isa import codec, text
from emu.image.model import Block, Image


@dataclass(frozen=True, slots=True)
class Item:
    """One instruction, vector or data word."""

    address: int
    words: tuple[int, ...]
    text: str


def instruction(image: Image, pc: int, word1: int, word2: int = 0) -> Item | None:
    """Disassemble the instruction at `pc`, with the image's symbols.

    Return None if the words are not an instruction.
    """
    insn = codec.decode(word1, word2)
    if insn is None:
        return None
    words = (word1, word2) if insn.words == 2 else (word1,)
    return Item(pc, words, text.format(insn, pc, lambda address, space: _name(image, address, space)))


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


def _name(image: Image, address: int, space: str) -> str | None:
    """Return the symbol of an operand's target address, None if there is none."""
    if space == "code":
        return image.symbols.text(address) if image.symbols.code(address) else None
    if address in image.chip.data["sfr"]:
        return image.register_names.get(address)
    found = image.symbols.data(address)
    if found is None:
        return None
    symbol, distance = found
    return f"{symbol.name}+{distance:#x}" if distance else symbol.name
