"""The `.dinit` table, from which crt0 initialises RAM (abi-elf.md §3.2).

Adjacent sections with the same treatment share a record, because each record takes three program words. Initialised
sections that contain only zeros are cleared, not copied.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from emu.image.elf_facts import OCTETS_PER_WORD, ExtendedAttribute, SectionFlag
from toolchain.elf import constants as c
from toolchain.elf.model import Section
from toolchain.link.place import Layout
from toolchain.link.synthesize import CODE

_HEADER_WORDS = 3
_NEVER = SectionFlag.PERSIST | SectionFlag.NOLOAD


class Format(IntEnum):
    """Format of a record: the low seven bits of its third word (abi-elf.md §3.2)."""

    CLEAR = 0
    COPY_TWO = 1  # two data bytes per program word
    COPY_THREE = 2


@dataclass(slots=True)
class DinitRecord:
    """One table entry: RAM address, length in bytes, format of its data, and the sections that it initialises."""

    address: int
    size: int
    format: Format
    sections: list[Section]

    @property
    def words(self) -> int:
        data = {Format.CLEAR: 0, Format.COPY_TWO: self.size // 2, Format.COPY_THREE: -(-self.size // 3)}
        return _HEADER_WORDS + data[self.format]


def plan(layout: Layout, pack: bool) -> list[DinitRecord]:
    """Return the records for all placed RAM sections, by address."""
    records: list[DinitRecord] = []
    for section, placed in sorted(layout.placed.items(), key=lambda item: item[1].address):
        skip = section.flags & _NEVER or section.extended & (ExtendedAttribute.HEAP | ExtendedAttribute.STACK)
        if not section.is_ram or skip or not placed.size:
            continue
        blank = section.type == c.SHT_NOBITS or not (any(section.data) or section.relocs)
        form = Format.CLEAR if blank else Format.COPY_THREE if pack else Format.COPY_TWO
        last = records[-1] if records else None
        if last and last.format is form and last.address + last.size == placed.address:
            last.size += placed.size
            last.sections.append(section)
        else:
            records.append(DinitRecord(placed.address, placed.size, form, [section]))
    return records


def empty_section(records: list[DinitRecord]) -> Section:
    """Return `.dinit` with its final length and without content; the end marker is one word."""
    words = sum(record.words for record in records) + 1
    return Section(".dinit", CODE, data=bytearray(words * OCTETS_PER_WORD))


def fill(section: Section, records: list[DinitRecord], contents: dict[Section, bytearray], fill_upper: int) -> None:
    """Write the table from the relocated `contents` of the data sections."""
    out = bytearray()

    def header(value: int) -> None:
        out.extend((value & 0xFF, value >> 8, fill_upper, 0))

    for record in records:
        header(record.address)
        header(record.size)
        header(record.format)
        if record.format is Format.CLEAR:
            continue
        data = b"".join(_plain(contents[s]) for s in record.sections)
        step = 3 if record.format is Format.COPY_THREE else 2
        for start in range(0, len(data), step):
            chunk = data[start : start + step]
            out += chunk + bytes(step - len(chunk)) + (b"" if step == 3 else bytes((fill_upper,))) + b"\0"
    header(0)
    section.data[:] = out


def _plain(octets: bytearray) -> bytes:
    """Return the data bytes of a section without phantoms, padded to even length."""
    data = bytes(octets[::2])
    return data + b"\0" * (len(data) & 1)
