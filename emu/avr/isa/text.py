"""Disassembler: AVR instructions as text, spelled as binutils spells them."""

from __future__ import annotations

import re

from emu.avr.core.state import FLASH_BYTES
from emu.avr.isa.codec import decode, row_of


def disassemble(word: int, second: int = 0, address: int = 0) -> str:
    """Return the instruction at byte address `address` as assembly text; `.word 0x....` for other words."""
    insn = decode(word, second)
    if insn is None or row_of(word) is None:
        return f".word 0x{word:04x}"
    row, values = insn.row, insn.operands
    mnemonic, _, operands = row.syntax.partition(" ")
    if row.aliases:
        mnemonic = row.aliases[values["b"]]
        operands = operands.replace("b", "").strip()
    if "q" in values and not values["q"]:  # without displacement it is LD or ST
        mnemonic, operands = mnemonic[:2], operands.replace("+q", "")

    def text(found: re.Match[str]) -> str:
        name = found[0]
        if name in ("Rd", "Rr"):
            return f"r{values[name[1]]}"
        if name == "k" and row.words == 1:
            return f".{2 * values['k']:+d}"
        if name == "k":
            return f"0x{values['k'] * (2 if mnemonic in ('jmp', 'call') else 1):x}"
        if name in ("b", "q"):
            return str(values[name])
        return f"0x{values[name]:02x}"

    return f"{mnemonic} {re.sub(r'Rd|Rr|[KAbqk]', text, operands)}".rstrip()


def target(word: int, second: int, address: int) -> int | None:
    """Return the byte address to which the instruction at `address` jumps, branches or calls; None for others."""
    insn = decode(word, second)
    if insn is None or "k" not in insn.operands or insn.row.mnemonic in ("lds", "sts"):
        return None
    words = insn.operands["k"] if insn.row.words > 1 else (address >> 1) + 1 + insn.operands["k"]
    return 2 * words % FLASH_BYTES
