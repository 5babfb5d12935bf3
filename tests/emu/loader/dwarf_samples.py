"""Constructed DWARF 2 of one unit with phantom bytes, as XC16 and our toolchain store it (abi-elf.md §6.7)."""

from __future__ import annotations

import struct

from tests.emu.loader.elf_samples import NOTE, SampleSection, doubled

ROWS = ((0x104, 10), (0x106, 12), (0x10A, 0))
"""(address, line) pairs of the sample's line program; the last one ends the sequence."""


def _line_program() -> bytes:
    """Return a line program: version 2, min_inst_length 1, line_base -10, line_range 245, opcode_base 10 (abi-elf.md
    §6.7)."""
    tables = b"src\0\0" + b"main.c\0" + bytes((1, 0, 0)) + b"\0"
    prologue = bytes((1, 1, 0xF6, 245, 10, 0, 1, 1, 1, 1, 0, 0, 0, 1)) + tables
    program = b"\0\x05\x02" + struct.pack("<I", ROWS[0][0])
    line, address = 1, ROWS[0][0]
    for place, number in ROWS[:-1]:
        program += b"\x02" + bytes((place - address,)) + b"\x03" + bytes((number - line & 0x7F,)) + b"\x01"
        line, address = number, place
    program += b"\x02" + bytes((ROWS[-1][0] - address,)) + b"\0\x01\x01"
    body = struct.pack("<HI", 2, len(prologue)) + prologue + program
    return struct.pack("<I", len(body)) + body


def debug_sections() -> list[SampleSection]:
    """Return `.debug_info`, `.debug_abbrev` and `.debug_line`, which can be added to a sample."""
    abbrev = bytes((1, 0x11, 0, 0x10, 6, 0x11, 1, 0x12, 1, 0, 0, 0))
    die = b"\x01" + struct.pack("<III", 0, ROWS[0][0], ROWS[-1][0])
    unit = struct.pack("<HIB", 2, 0, 4) + die
    info = struct.pack("<I", len(unit)) + unit
    return [
        SampleSection(name, 0, doubled(content), 0, NOTE)
        for name, content in ((".debug_info", info), (".debug_abbrev", abbrev), (".debug_line", _line_program()))
    ]
