"""One instruction of a dsPIC30F's image as text, with symbols as operands."""

from __future__ import annotations

from dataclasses import dataclass

from emu.dspic30f.isa import codec, text
from emu.image.model import Image


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


def _name(image: Image, address: int, space: str) -> str | None:
    """Return the symbol of an operand's target address, None if there is none."""
    if space == "code":
        return image.symbols.text(address) if image.symbols.code(address) else None
    if address in image.chip.data["sfr"]:
        return image.register_names.get(address)
    found = image.symbols.variable_at(address)
    if found is None:
        return None
    symbol, distance = found
    return f"{symbol.name}+{distance:#x}" if distance else symbol.name
