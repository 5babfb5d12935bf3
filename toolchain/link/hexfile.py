"""Intel HEX as Microchip's bin2hex writes it (abi-elf.md §6.8): byte address = 2 x PC, four bytes per program word."""

from __future__ import annotations

from collections.abc import Iterable

from emu.image.elf_facts import OCTETS_PER_UNIT, SectionFlag
from toolchain.elf import constants as c
from toolchain.elf.model import Executable, Section

RECORD_BYTES = 16
_DATA, _END, _UPPER_ADDRESS = 0, 1, 4


def _record(kind: int, address: int, data: bytes) -> str:
    body = bytes((len(data), address >> 8 & 0xFF, address & 0xFF, kind)) + data
    return f":{body.hex()}{-sum(body) & 0xFF:02x}"


def loadable(sections: Iterable[Section]) -> list[Section]:
    """Return the sections with program memory content, by load address; a HEX file has no RAM contents (§6.8)."""
    program = SectionFlag.EXECINSTR | SectionFlag.PSV | SectionFlag.EEDATA
    found = [
        s
        for s in sections
        if s.type == c.SHT_PROGBITS and s.data and s.flags & program and not s.flags & SectionFlag.NOLOAD
    ]
    return sorted(found, key=lambda s: s.load)


def hex_text(image: Executable) -> str:
    """Return the whole image as Intel HEX text, sections sorted by address."""
    lines: list[str] = []
    for section in loadable(image.sections):
        address, upper = section.load * OCTETS_PER_UNIT, -1
        for start in range(0, len(section.data), RECORD_BYTES):
            at = address + start
            data = bytes(section.data[start : start + RECORD_BYTES])
            while data:
                if at >> 16 != upper:
                    upper = at >> 16
                    lines.append(_record(_UPPER_ADDRESS, 0, upper.to_bytes(2, "big")))
                room = 0x10000 - (at & 0xFFFF)
                lines.append(_record(_DATA, at & 0xFFFF, data[:room]))
                at, data = at + len(data[:room]), data[room:]
    lines.append(_record(_END, 0, b""))
    return "\n".join(lines) + "\n"
