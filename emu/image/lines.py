"""Source lines of program addresses, from DWARF (abi-elf.md §6.7).

Input: raw octets of debug sections. Output: file and line per address. Microchip's tools store every DWARF byte as
two octets (byte, phantom 0); this project's tools do so in objects and on request. Plain DWARF is also accepted.
Unreadable debug information is ignored.
"""

from __future__ import annotations

import inspect
import io
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from elftools.dwarf.dwarfinfo import DWARFInfo

_NEEDED: Final = (".debug_info", ".debug_abbrev", ".debug_line")
_TEXT_SECTIONS: Final = (".debug_info", ".debug_abbrev")
DW_OP_ADDR: Final = 0x03
"""Operation DW_OP_addr: a fixed address, 4 bytes here (DWARF 2 §7.7.1)."""
_DOUBLED_SHARE: Final = 0.9
"""Minimum share of zeros among the odd octets of a doubled section. It is below 1 because one attribute of assembler
units has its high byte in the phantom (abi-elf.md §6.7)."""


@dataclass(frozen=True, slots=True)
class SourceLine:
    """Program addresses `start`..`end` (exclusive, in PC units), compiled from `line` of `file`."""

    start: int
    end: int
    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


def remove_phantom_octets(sections: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return debug sections by name, without phantom octets if there are any.

    Only the sections with names and strings decide this, because a plain list of small addresses also has zeros at odd
    octets.
    """
    phantoms = b"".join(sections.get(name, b"")[1::2] for name in _TEXT_SECTIONS)
    if phantoms and phantoms.count(0) >= _DOUBLED_SHARE * len(phantoms):
        return {name: octets[::2] for name, octets in sections.items()}
    return dict(sections)


class LineTable:
    """Line table of an image, without the compilation units that cannot be read."""

    def __init__(self, sections: Mapping[str, bytes]) -> None:
        self.rows: Final[list[SourceLine]] = []
        self._sections: Final = sections if all(sections.get(name) for name in _NEEDED) else {}
        for dwarf, unit in self._units():
            with suppress(Exception):
                self.rows.extend(_unit_rows(dwarf, unit))
        self.rows.sort(key=lambda row: (row.start, row.end))
        self._starts: Final = [row.start for row in self.rows]

    def __len__(self) -> int:
        return len(self.rows)

    def find(self, pc: int) -> SourceLine | None:
        """Return the source line of the instruction at `pc`, None if unknown."""
        index = bisect_right(self._starts, pc) - 1
        if index >= 0 and pc < self.rows[index].end:
            return self.rows[index]
        return None

    @cached_property
    def files(self) -> dict[int, str]:
        """Source file of each variable, by data address."""
        found: dict[int, str] = {}
        for dwarf, unit in self._units():
            with suppress(Exception):
                found.update(_variables(dwarf, unit))
        return found

    def _units(self) -> Iterator[tuple[DWARFInfo, Any]]:
        # pyelftools raises many unrelated exceptions for damaged input, so each unit is read separately.
        if not self._sections:
            return
        try:
            dwarf = dwarf_of(self._sections)
            units = dwarf.iter_CUs()
        except Exception:
            return
        while True:
            try:
                unit = next(units, None)
            except Exception:
                return
            if unit is None:
                return
            yield dwarf, unit


def dwarf_of(sections: Mapping[str, bytes]) -> DWARFInfo:
    """Return a pyelftools view of debug sections, whether doubled or plain."""
    from elftools.dwarf.dwarfinfo import DebugSectionDescriptor, DwarfConfig, DWARFInfo

    plain = remove_phantom_octets({name: octets for name, octets in sections.items() if name.startswith(".debug_")})

    def descriptor(name: str) -> DebugSectionDescriptor | None:
        if name not in plain:
            return None
        octets = plain[name]
        return DebugSectionDescriptor(io.BytesIO(octets), name, 0, len(octets), 0)

    config = DwarfConfig(little_endian=True, machine_arch="dsPIC30F", default_address_size=4)
    wanted = [name for name in inspect.signature(DWARFInfo).parameters if name.endswith("_sec")]
    return DWARFInfo(config, **{name: descriptor("." + name.removesuffix("_sec")) for name in wanted})


def _unit_rows(dwarf: DWARFInfo, unit: Any) -> list[SourceLine]:
    """Return the line table of one compilation unit as address ranges."""
    program = dwarf.line_program_for_CU(unit)
    if program is None:
        return []
    names = file_names(program.header)
    rows: list[SourceLine] = []
    before = None
    for entry in program.get_entries():
        state = entry.state
        if state is None:
            continue
        if before is not None and state.address > before.address:
            name = names[before.file] if 0 <= before.file < len(names) else "?"
            rows.append(SourceLine(before.address, state.address, name, before.line))
        before = None if state.end_sequence else state
    return rows


def _variables(dwarf: DWARFInfo, unit: Any) -> dict[int, str]:
    """Return the declaring source file of each variable of a unit with a fixed address, by address."""
    program = dwarf.line_program_for_CU(unit)
    names = file_names(program.header) if program is not None else []
    found = {}
    for die in unit.iter_DIEs():
        if die.tag != "DW_TAG_variable" or "DW_AT_location" not in die.attributes:
            continue
        place = die.attributes["DW_AT_location"].value
        file = die.attributes.get("DW_AT_decl_file")
        if isinstance(place, list) and len(place) == 5 and place[0] == DW_OP_ADDR and file is not None:
            number = file.value
            found[int.from_bytes(bytes(place[1:]), "little")] = names[number] if number < len(names) else "?"
    return found


def file_names(header: Any) -> list[str]:
    """Return the paths of a line program's files by file number. Before DWARF 5, numbers start at 1."""
    folders = [folder.decode("utf-8", "replace") for folder in header["include_directory"]]
    names = [] if header["version"] >= 5 else ["?"]
    for entry in header["file_entry"]:
        name = entry.name.decode("utf-8", "replace")
        place = entry.dir_index if header["version"] >= 5 else entry.dir_index - 1
        folder = folders[place] if 0 <= place < len(folders) and not name.startswith("/") else ""
        names.append(f"{folder}/{name}" if folder else name)
    return names
