"""C code made from the instruction table: rows of the decoder, extraction of operands, instructions."""

from __future__ import annotations

import re
from typing import Final

from emu.avr.isa.row import FIELDS, Row
from emu.avr.isa.rows import ERASED, ERASED_BITS, ROWS

SLOTS: Final = {"d": "d", "r": "r", "b": "r", "K": "k", "A": "k", "q": "k", "k": "k"}
"""Member of `struct insn` that holds each operand."""
NAMES: Final = {"Rd": "data[d]", "Rr": "data[r]", "R0": "data[0]"}


SPECIAL: Final = ("ILLEGAL", "END", "COUNT_DOWN", "RESTART")
"""Operations without a row, numbered after those of the rows. `row_of` returns ILLEGAL for a word without a row."""


def decoder() -> str:
    """Return the C text of the operations, of `row_of` and of `operands_of`."""
    lines = [f"enum {{ {', '.join('OP_' + name for name in (*(row.name for row in ROWS), *SPECIAL))}, OPS }};",
             f"enum {{ ERASED = {ERASED:#06x}, ERASED_BITS = {ERASED_BITS:#06x} }};",
             "static const struct { u16 mask, match; u8 words; } rows[OPS] = {"]  # fmt: skip
    lines += [f"    {{{row.mask:#06x}, {row.match:#06x}, {row.words}}}," for row in ROWS]
    lines += ["};", "static void operands_of(struct insn *i, u32 op, u32 word, u32 second, u32 pc)", "{",
              "    switch (op) {"]  # fmt: skip
    for row in ROWS:
        sets = "".join(f" i->{SLOTS[FIELDS[letter].operand]} = {_value(row, letter)};" for letter in row.letters)
        if row.words > 1:
            sets = re.sub(r" i->k = [^;]*;", "", sets) + " i->k = (u16)second;"
        lines.append(f"    case OP_{row.name}:{sets} break;")
    return "\n".join([*lines, "    }", "    (void)second, (void)pc;", "}"])


def _value(row: Row, letter: str) -> str:
    """Return the C expression of an operand's value. A branch's is the word address of its target."""
    bits = row.letters[letter]
    runs: list[tuple[int, int, int]] = []  # (lowest bit in the word, lowest bit in the value, width)
    for place, bit in enumerate(bits):
        low = len(bits) - 1 - place
        if runs and runs[-1][0] == bit + 1 and runs[-1][1] == low + 1:
            runs[-1] = (bit, low, runs[-1][2] + 1)
        else:
            runs.append((bit, low, 1))
    raw = " | ".join(f"(word >> {bit} & {(1 << width) - 1:#x}) << {low}" for bit, low, width in runs)
    field = FIELDS[letter]
    if field.operand == "k":
        sign = 1 << (len(bits) - 1)
        return f"(u16)((pc + 1 + (({raw}) ^ {sign:#x}) - {sign:#x}) & PC_MASK)"
    if field.operand == "A":
        return f"(u16)(({raw}) + IO_START)"
    kind = "u16" if SLOTS[field.operand] == "k" else "u8"
    return f"({kind})({field.first} + {field.step} * ({raw}))"


def labels() -> str:
    """Return the C text of the interpreter's table of labels, by operation."""
    names = ", ".join(f"&&do_{name}" for name in (*(row.name for row in ROWS), *SPECIAL))
    return f"static const void *const labels[OPS] = {{{names}}};"


def bodies() -> str:
    """Return the C text of all instructions, each with its label."""
    return "\n".join(_body(row) for row in ROWS)


def _body(row: Row) -> str:
    operands = sorted({FIELDS[letter].operand for letter in row.letters} | ({"k"} if row.words > 1 else set()))
    does = re.sub(r"\bR[dr0]\b", lambda found: NAMES[found[0]], row.does)
    used = [name for name in operands if re.search(rf"\b{name}\b", does)]
    locals_ = "".join(f" const u32 {name} = insn->{SLOTS[name]};" for name in used)
    return f"do_{row.name}: {{{locals_} START({row.words}, {row.cycles}); {does} NEXT({row.cycles}); }}"
