"""Source positions of an image, from its debug information: files, functions and lines."""

from __future__ import annotations

import posixpath
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from typing import Any, Final

from emu.image.lines import LineTable, dwarf_of, file_names
from toolchain.elf.annotations import Annotation
from toolchain.elf.signatures import refused_if_damaged
from toolchain.errors import ToolError

LineKey = tuple[str, int]


class SourceMap:
    """Maps instructions and annotations to source lines.

    Files are named as in the debug information; annotations may name them relative to another folder.
    """

    def __init__(self, debug: Mapping[str, bytes]) -> None:
        self.lines: Final = LineTable(debug)
        self.functions: Final[dict[int, tuple[str, str]]] = {}
        """File and name of each function, by address."""
        self._first_lines: Final[dict[str, dict[int, str]]] = {}
        """By file: first line -> name of each function, including inlined ones."""
        self._read(debug)
        self._code: Final[dict[str, list[int]]] = {}
        for file, number in sorted({(row.file, row.line) for row in self.lines.rows}):
            self._code.setdefault(file, []).append(number)
        self._all: Final = sorted({*self._code, *self._first_lines, *self.lines.files.values()})
        self._targets: Final[dict[Annotation, LineKey | None]] = {}
        self._matching: Final[dict[str, list[str]]] = {}

    def _read(self, debug: Mapping[str, bytes]) -> None:
        if not debug.get(".debug_info"):
            return
        with refused_if_damaged():
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
        values = [die.attributes.get("DW_AT_" + what) for what in ("name", "decl_file", "decl_line")]
        if None in values:
            return
        name, file, line = (attribute.value for attribute in values)
        if file < len(names):
            self._first_lines.setdefault(names[file], {})[line] = name.decode()
            if begin is not None and begin.value:  # 0 is the address of a function that the linker dropped
                self.functions[begin.value] = names[file], name.decode()

    def line_of(self, pc: int) -> LineKey:
        """Return file and line of an instruction, ("", 0) if unknown."""
        found = self.lines.find(pc)
        return (found.file, found.line) if found else ("", 0)

    def matching_files(self, name: str) -> list[str]:
        """Return the files that a path may denote: those with the most matching trailing folders."""
        if name not in self._matching:
            wanted = _components(name)
            matches = {file: _common_suffix(wanted, _components(file)) for file in self._all}
            most = max(matches.values(), default=0)
            self._matching[name] = [file for file, count in matches.items() if count == most] if most else []
        return self._matching[name]

    def file_of(self, annotation: Annotation) -> str | None:
        """Return the file of an annotation, None if the image has no code of it; raise `ToolError` if ambiguous."""
        files = self.matching_files(annotation.file)
        if annotation.function:
            files = [file for file in files if annotation.function in self._first_lines.get(file, {}).values()]
        if len(files) > 1:
            raise ToolError(
                f"{annotation.place}: ambiguous file: {' or '.join(files)}: compile them by paths that differ"
            )
        return files[0] if files else None

    def declares(self, file: str, function: str) -> bool:
        """Whether a file defines a function of that name, even if every call of it is inlined."""
        return function in self._first_lines.get(file, {}).values()

    def target_line(self, annotation: Annotation) -> LineKey | None:
        """Return the line that an annotation refers to: its own, or else the next line of the function with code.

        None if the image has no code of the function.  Raises `ToolError` if the function has no code after it.
        """
        if annotation not in self._targets:
            self._targets[annotation] = self._find_target_line(annotation)
        return self._targets[annotation]

    def _find_target_line(self, annotation: Annotation) -> LineKey | None:
        file = self.file_of(annotation)
        if file is None:
            return None
        begins = self._first_lines.get(file, {})
        starts = sorted(begins)
        index = bisect_right(starts, annotation.line)
        end = starts[index] if index < len(starts) else 1 << 30
        code = self._code.get(file, [])
        first = next((line for line in code if annotation.line <= line < end), None)
        if first is not None:
            return file, first
        start = starts[index - 1] if index else 0
        if begins.get(start) == annotation.function and any(start <= line < end for line in code):
            raise ToolError(f"{annotation.place}: {annotation.function} has no code after this annotation")
        return None

    def function_extent(self, line: LineKey) -> tuple[int, int]:
        """Return the range of lines, end excluded, of the function that a line belongs to."""
        starts = sorted(self._first_lines.get(line[0], {}))
        index = bisect_right(starts, line[1])
        return starts[index - 1] if index else 0, starts[index] if index < len(starts) else 1 << 30

    def address_ranges(self, line: LineKey) -> list[tuple[int, int]]:
        """Return the address ranges of a line."""
        return [(row.start, row.end) for row in self.lines.rows if (row.file, row.line) == line]


def _components(name: str) -> list[str]:
    """Return folders and name of a path without `.` and `..`."""
    parts = posixpath.normpath(name.replace("\\", "/")).split("/")
    return [part for part in parts if part not in ("", "..", ".")]


def _common_suffix(a: Iterable[str], b: Iterable[str]) -> int:
    """Return how many trailing parts two paths have in common, 0 if neither is a suffix of the other."""
    one, other = list(a)[::-1], list(b)[::-1]
    common = min(len(one), len(other))
    return common if one[:common] == other[:common] else 0


__all__ = ["LineKey", "SourceMap"]
