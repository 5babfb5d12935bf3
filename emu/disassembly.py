"""Program words of an image as assembly: what each address holds, with labels and source lines.

What enters: an image. What leaves: `Item`s in address order, for `emu disasm`, traces and fault reports.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from emu.dspic30f.isa import codec, text
from emu.image import Block, Image

DATA_SECTIONS = frozenset({"section '.dinit'"})
"""Sections with code flags that hold no instructions: the table crt0 initialises RAM from (abi-elf.md §3.2)."""


@dataclass(frozen=True, slots=True)
class Item:
    """One instruction, vector or data word."""

    address: int
    words: tuple[int, ...]
    text: str


def instruction(image: Image, pc: int, word1: int, word2: int = 0) -> Item | None:
    """The instruction at `pc`, None if the words are not one. Targets are named by the image's symbols."""
    insn = codec.decode(word1, word2)
    if insn is None:
        return None
    words = (word1, word2) if insn.words == 2 else (word1,)
    return Item(pc, words, text.format(insn, pc, lambda address: _name(image, address)))


def items(image: Image, start: int, end: int) -> Iterator[Item]:
    """Everything the image defines in flash from `start` up to `end`."""
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
    """What stands at `address` inside `block`."""
    index = (address - block.base) // 2
    word = block.words[index]
    if address in vectors:
        return Item(address, (word,), f".pword {word:#08x} ; {vectors[address]} -> {image.symbols.text(word)}")
    if block.origin not in DATA_SECTIONS:
        second = block.words[index + 1] if index + 1 < len(block.words) else 0
        found = instruction(image, address, word, second)
        if found is not None and index + len(found.words) <= len(block.words):
            return found
    return Item(address, (word,), f".pword {word:#08x}")


def _name(image: Image, address: int) -> str | None:
    """A branch target's name, None where no symbol helps."""
    return image.symbols.text(address) if image.symbols.code(address) else None
