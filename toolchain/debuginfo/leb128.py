"""LEB128 numbers (DWARF 2 §7.6) as assembler operands, one per byte."""

from __future__ import annotations


def uleb(value: int) -> list[str]:
    """Return an unsigned LEB128 number."""
    out = []
    while True:
        byte, value = value & 0x7F, value >> 7
        out.append(str(byte | (0x80 if value else 0)))
        if not value:
            return out


def sleb(value: int) -> list[str]:
    """Return a signed LEB128 number."""
    out = []
    while True:
        byte, value = value & 0x7F, value >> 7
        done = (value == 0 and not byte & 0x40) or (value == -1 and byte & 0x40)
        out.append(str(byte | (0 if done else 0x80)))
        if done:
            return out
