"""Relaxation, only with --relax: CALL -> RCALL and GOTO -> BRA within a section (abi-elf.md §5).

Precondition: every relaxable call is alone in its piece, in its two-word form.  Result: pieces have their final start.
The algorithm starts with all calls short and makes a call long if its target is out of range. A long call stays long,
so the iteration terminates.
"""

from __future__ import annotations

from toolchain.asm.sections import AsmSection, Relaxable
from toolchain.asm.symbols import Label
from toolchain.elf.model import Bind

REACH = (-0x8000, 0x7FFF)  # least and greatest distance of RCALL and BRA in words (Slit16, isa.md §3.2)


def _candidates(section: AsmSection) -> list[Relaxable]:
    return [
        r
        for r in section.relaxables
        if isinstance(r.target.place, Label)
        and r.target.place.frag.section is section
        and r.target.bind is not Bind.WEAK
    ]


def _place(section: AsmSection, short: set[int]) -> None:
    start = 0
    for piece in section.pieces:
        piece.start = start
        octets = 4 if id(piece) in short else len(piece.data)
        start += octets // 2 if section.is_code else octets


def relax(section: AsmSection) -> None:
    """Choose the form of every relaxable call and set the final start of all pieces."""
    candidates = _candidates(section)
    short = {id(r.piece) for r in candidates}
    while True:
        _place(section, short)
        grown = [r for r in candidates if id(r.piece) in short and not _reaches(r)]
        if not grown:
            break
        short -= {id(r.piece) for r in grown}
    for entry in section.relaxables:
        if id(entry.piece) in short:
            entry.piece.data = bytearray(entry.short)
        section.fixups.append(entry.short_fixup if id(entry.piece) in short else entry.fixup)


def _reaches(entry: Relaxable) -> bool:
    place = entry.target.place
    assert isinstance(place, Label)
    distance = place.frag.start + place.offset - (entry.piece.start + 2)
    return REACH[0] <= distance // 2 <= REACH[1]
