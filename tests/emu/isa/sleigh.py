"""Comparison with an independent decoder: Ghidra's SLEIGH description of the dsPIC30F, through pypcode.

``disagreement`` classifies a word for which the texts differ; ``docs/census.md`` explains every class. Differences in
notation (case, spaces, radix, ACCA for A, signed targets) are removed before the comparison.
"""

from __future__ import annotations

import re

import pypcode

from emu.dspic30f.isa import codec, text
from emu.dspic30f.isa.row import Insn

LANGUAGE = "dsPIC30F:LE:24:default"
PC = 0x1000
NUMBER = re.compile(r"(?<!\w)([+-]?)(0x[0-9a-f]+|\d+)")
CONTEXT = pypcode.Context(LANGUAGE)

# Classes of differing texts, by row of the table.
BIT_FORMS = {116, 118, 120, 122, 127, 130, 132}
ROW_CLASSES = (
    ("word notation of f-bit forms", BIT_FORMS),
    ("CPB Wb,#lit5 with fixed register and size", {108}),
    ("index register of accumulator instructions", {47, 48, 49, 50}),
    ("prefetch of CLR Acc", {227}),
    ("MOV.B literal without #", {174}),
    ("PWRSAV literal without #", {218}),
    ("SETM WREG with a file address", {96}),
    ("SL without .w", {98, 99}),
    ("PUSH, POP, PUSH.D, POP.D for moves through W15", {178, 179, 180}),
)


def sleigh_text(word1: int, word2: int = 0) -> str | None:
    """Return SLEIGH's text of an instruction at PC, or None if SLEIGH does not decode it."""
    octets = word1.to_bytes(4, "little") + word2.to_bytes(4, "little")
    try:
        found = CONTEXT.disassemble(octets, base_address=2 * PC, max_instructions=1).instructions
    except pypcode.BadDataError:
        return None
    return f"{found[0].mnem} {found[0].body}"


def plain(assembly: str) -> str:
    """Return a text in a common notation, with numbers modulo 2**23."""
    assembly = re.sub(r"\bacc([ab])\b", r"\1", assembly.lower()).replace("+-", "-")
    assembly = NUMBER.sub(lambda m: f",{int(m[1] + m[2], 0) % (1 << 23):x}", assembly)
    mnemonic, _, operands = assembly.partition(" ")
    return f"{mnemonic} {re.sub(',+', ',', operands.replace(' ', '')).replace('#,', '#').strip(',')}"


def disagreement(word1: int, word2: int = 0) -> str | None:
    """Return the name of the class of disagreement, or None if both agree."""
    ours, other = codec.decode(word1, word2), sleigh_text(word1, word2)
    if ours is None and other is None:
        return None
    if other is None:
        return "not decoded by SLEIGH"
    if ours is None:
        return _illegal_class(word1, word2)
    if plain(text.format(ours, PC, source=True)) == plain(other):
        return None
    return _text_class(ours)


def _illegal_class(word1: int, word2: int) -> str:
    loose = codec.decode_loosely(word1, word2)
    if loose is not None:
        return f"broken rule {loose.row.broken(loose.x)[0].text}"
    return f"reserved bits, opcode byte {word1 >> 16:02X}"


def _text_class(insn: Insn) -> str:
    for name, rows in ROW_CLASSES:
        if insn.row.id in rows:
            return name
    return f"text of row {insn.row.id}"
