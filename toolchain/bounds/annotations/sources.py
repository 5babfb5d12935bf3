"""Where in the source something stands: files, functions and lines of an image, from its debug information."""

from __future__ import annotations

import posixpath
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from typing import Any, Final

from emu.image.lines import Lines, dwarf_of, file_names
from toolchain.bounds.annotations.notes import Note
from toolchain.errors import ToolError

Line = tuple[str, int]


class Sources:
    """Finds what notes speak of. Files are those of the debug information; notes name them from another folder on."""

    def __init__(self, debug: Mapping[str, bytes]) -> None:
        self.lines: Final = Lines(debug)
        self.functions: Final[dict[int, tuple[str, str]]] = {}
        """File and name of functions by address."""
        self._begins: Final[dict[str, dict[int, str]]] = {}
        """Functions of a file, inlined ones too, by the line they begin in."""
        self._read(debug)
        self._code: Final[dict[str, list[int]]] = {}
        for file, number in sorted({(row.file, row.line) for row in self.lines.rows}):
            self._code.setdefault(file, []).append(number)
        self._all: Final = sorted({*self._code, *self._begins, *self.lines.files.values()})
        self._targets: Final[dict[Note, Line | None]] = {}

    def _read(self, debug: Mapping[str, bytes]) -> None:
        if not debug.get(".debug_info"):
            return
        dwarf = dwarf_of(debug)
        for unit in dwarf.iter_CUs():
            program = dwarf.line_program_for_CU(unit)
            names = file_names(program.header) if program is not None else []
            for die in unit.iter_DIEs():
                if die.tag == "DW_TAG_subprogram":
                    self._function(die, names)

    def _function(self, die: Any, names: list[str]) -> None:
        begin = die.attributes.get("DW_AT_low_pc")
        if "DW_AT_abstract_origin" in die.attributes:
            die = die.get_DIE_from_attribute("DW_AT_abstract_origin")
        said = [die.attributes.get("DW_AT_" + what) for what in ("name", "decl_file", "decl_line")]
        if None in said:
            return
        name, file, line = (attribute.value for attribute in said)
        if file < len(names):
            self._begins.setdefault(names[file], {})[line] = name.decode()
            if begin is not None:
                self.functions[begin.value] = names[file], name.decode()

    def at(self, pc: int) -> Line:
        """File and line of an instruction; ("", 0) where they are not known."""
        found = self.lines.find(pc)
        return (found.file, found.line) if found else ("", 0)

    def files(self, name: str) -> list[str]:
        """The files a path may mean: those that agree with it in the most folders."""
        wanted = _parts(name)
        agreeing = {file: _agreeing(wanted, _parts(file)) for file in self._all}
        most = max(agreeing.values(), default=0)
        return [file for file, count in agreeing.items() if count == most] if most else []

    def of(self, note: Note) -> str | None:
        """The file of a note; None if none of its code is there. Raises `ToolError` where it may be several."""
        files = self.files(note.file)
        if note.function:
            files = [file for file in files if note.function in self._begins.get(file, {}).values()]
        if len(files) > 1:
            raise ToolError(f"{note.place}: this may be {' or '.join(files)}: compile them by paths that differ")
        return files[0] if files else None

    def declares(self, file: str, function: str) -> bool:
        """Whether a file has a function of that name, be it inlined everywhere."""
        return function in self._begins.get(file, {}).values()

    def target(self, note: Note) -> Line | None:
        """The line a note speaks of: its own, if code stands there, else the next of its function that has code.

        None where nothing of the function is left. Raises `ToolError` for a note behind all code of its function.
        """
        if note not in self._targets:
            self._targets[note] = self._target(note)
        return self._targets[note]

    def _target(self, note: Note) -> Line | None:
        file = self.of(note)
        if file is None:
            return None
        begins = self._begins.get(file, {})
        starts = sorted(begins)
        index = bisect_right(starts, note.line)
        end = starts[index] if index < len(starts) else 1 << 30
        code = self._code.get(file, [])
        first = next((line for line in code if note.line <= line < end), None)
        if first is not None:
            return file, first
        start = starts[index - 1] if index else 0
        if begins.get(start) == note.function and any(start <= line < end for line in code):
            raise ToolError(f"{note.place}: no code of {note.function} stands behind this note")
        return None

    def extent(self, line: Line) -> tuple[int, int]:
        """First line, and the one behind the last, of the function a line belongs to."""
        starts = sorted(self._begins.get(line[0], {}))
        index = bisect_right(starts, line[1])
        return starts[index - 1] if index else 0, starts[index] if index < len(starts) else 1 << 30

    def instructions(self, line: Line) -> list[tuple[int, int]]:
        """Ranges of addresses of a line."""
        return [(row.start, row.end) for row in self.lines.rows if (row.file, row.line) == line]


def _parts(name: str) -> list[str]:
    """Folders and name of a path, without those that lead out of where it begins."""
    parts = posixpath.normpath(name.replace("\\", "/")).split("/")
    return [part for part in parts if part not in ("", "..", ".")]


def _agreeing(a: Iterable[str], b: Iterable[str]) -> int:
    """How many parts two paths have in common at their ends; 0 if neither is the end of the other."""
    one, other = list(a)[::-1], list(b)[::-1]
    common = min(len(one), len(other))
    return common if one[:common] == other[:common] else 0


__all__ = ["Line", "Sources"]
