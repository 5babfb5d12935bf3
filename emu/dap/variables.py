"""Responses about a paused machine: scopes, variables, registers, sources, disassembly.

References to variables and frames are valid until the machine runs again. Their numbers are not reused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote

from emu.debug.dwarf.location import Piece, Unavailable
from emu.debug.dwarf.types import UNSIGNED, parts_of
from emu.debug.frame import Frame
from emu.debug.inspector import Inspector
from emu.debug.value import Value
from emu.host.sources import SourceFinder
from emu.image.lines import SourceLine

FLAGS: Final = ("C", "Z", "OV", "N", "RA", "DC", "DA", "SAB", "OAB", "SB", "SA", "OB", "OA")
POSTFIX: Final = re.compile(r"[\w$][\w$.\[\]>-]*|\(\*\(.*\)\)[\w.\[\]]*")
"""Expressions to which a member access can be appended without parentheses."""
Row = dict[str, Any]


class ReferenceTable:
    """Variable and frame references of the current stop.

    `world` returns the state of the environment; None if there is no environment.
    """

    def __init__(
        self, inspector: Inspector, sources: SourceFiles, world: Callable[[], list[tuple[str, str]]] | None = None
    ) -> None:
        self.inspector = inspector
        """Inspector of the debugged machine. References remain valid for another machine in the same state."""
        self._sources: Final = sources
        self._world: Final = world
        self.last_reference = 0
        """Number of the reference created last."""
        self._frames: dict[int, Frame] = {}
        self._lists: dict[int, Callable[[], Iterator[tuple[str, Value | None, str]]]] = {}

    def clear(self) -> None:
        """Invalidate all references, because the machine runs again."""
        self._frames.clear()
        self._lists.clear()

    def frame(self, number: int | None) -> Frame | None:
        """Return the frame with a reference number, for None the innermost one. Raises ValueError if it is invalid."""
        if number is not None:
            if number not in self._frames:
                raise ValueError(f"frame {number} is not valid at this stop")
            return self._frames[number]
        frames = self.inspector.frames()
        return frames[0] if frames else None

    def stack(self, frames: list[Frame]) -> list[Row]:
        """Return frames in the form of the protocol."""
        rows = []
        for frame in frames:
            self.last_reference += 1
            self._frames[self.last_reference] = frame
            row: Row = {
                "id": self.last_reference,
                "name": frame.function + (" <interrupt>" if frame.kind == "interrupt" else ""), "line": 0,
                "column": 0, "instructionPointerReference": f"{frame.pc:#08x}",
            }  # fmt: skip
            if frame.line is not None and frame.line.line:
                row |= {"line": frame.line.line, "column": 1, "source": self._sources.row(frame.line.file)}
            else:
                row["presentationHint"] = "subtle"
            rows.append(row)
        return rows

    def scopes(self, frame: Frame) -> list[Row]:
        """Return the scopes: locals, statics of the file, registers, SFRs, and the environment."""
        unit = frame.scopes[0].unit if frame.scopes else -1

        def of_variables(names: list[Any]) -> Callable[[], Iterator[tuple[str, Value | None, str]]]:
            def rows() -> Iterator[tuple[str, Value | None, str]]:
                for one in names:
                    try:
                        yield one.name, self.inspector.value(one, frame), one.name
                    except Unavailable as why:
                        yield one.name, None, f"<{why}>"

            return rows

        local_rows = of_variables(self.inspector.variables(frame))
        statics = of_variables(list(self.inspector.debug.statics.get(unit, {}).values()))
        everything = [("Locals", local_rows, "locals", False), ("Statics", statics, "", False),
                      ("Registers", lambda: self._registers(frame), "registers", False),
                      ("SFRs", self._sfrs, "registers", True)]  # fmt: skip
        if self._world is not None:
            everything.append(("World", self._environment_rows, "", True))
        return [
            {"name": name, "variablesReference": self._new_reference(rows), "expensive": slow}
            | ({"presentationHint": hint} if hint else {})
            for name, rows, hint, slow in everything
        ]

    def _environment_rows(self) -> Iterator[tuple[str, Value | None, str]]:
        for name, text in self._world() if self._world is not None else ():
            yield name, None, text

    def _registers(self, frame: Frame) -> Iterator[tuple[str, Value | None, str]]:
        view = self.inspector.view(frame)
        processor = self.inspector.processor
        for number, name in enumerate(processor.register_names):
            known = view.register(number) is not None
            value = Value(UNSIGNED[processor.register_size(number)], (Piece("register", number),), view, name)
            yield name, value if known else None, name if known else "<not known in this frame>"
        yield "PC", None, f"{frame.pc:#08x}"
        yield processor.status_register, self._sfr(processor.status_register), processor.status_register
        yield "cycle", None, f"{self.inspector.machine.cycle:,}"

    def _sfr(self, name: str) -> Value:
        sfr = self.inspector.image.chip.sfrs[name]
        return Value(UNSIGNED[sfr.size], (Piece("memory", sfr.address),), self.inspector.view(), name)

    def _sfrs(self) -> Iterator[tuple[str, Value | None, str]]:
        for name in sorted(self.inspector.image.chip.sfrs):
            yield name, self._sfr(name), name

    def _fields(self, value: Value) -> Callable[[], Iterator[tuple[str, Value | None, str]]]:
        fields = self.inspector.image.chip.sfrs[value.name].fields

        def rows() -> Iterator[tuple[str, Value | None, str]]:
            for name, (lsb, width) in fields.items():
                part = Value(value.type, value.pieces, self.inspector.view(), name, (width, lsb))
                yield name, part, f"{value.name}.{name}"

        return rows

    def _new_reference(self, rows: Callable[[], Iterator[tuple[str, Value | None, str]]]) -> int:
        self.last_reference += 1
        self._lists[self.last_reference] = rows
        return self.last_reference

    def variables(self, reference: int, start: int = 0, count: int = 0) -> list[Row]:
        """Return the rows of a variable list from index `start`; a `count` of 0 means all."""
        rows = self._list(reference)
        found = []
        for index, (name, value, path) in enumerate(rows()):
            if index < start or (count and index >= start + count):
                continue
            found.append({"name": name, "value": path, "variablesReference": 0} if value is None
                         else {"name": name, **self.row_of(value, path)})  # fmt: skip
        return found

    def find(self, reference: int, name: str) -> Value | None:
        """Return the value called `name` in a variable list, None if there is none."""
        return next((value for one, value, _ in self._list(reference)() if one == name), None)

    def _list(self, reference: int) -> Callable[[], Iterator[tuple[str, Value | None, str]]]:
        """Return the variable list with a reference number. Raises ValueError if it is invalid."""
        if reference not in self._lists:
            raise ValueError(f"reference {reference} is not valid at this stop")
        return self._lists[reference]

    def row_of(self, value: Value, path: str) -> Row:
        """Return a value's text, type and references. `path` is an expression that denotes the value."""
        row: Row = {"value": value.text(), "type": str(value.type), "variablesReference": 0, "evaluateName": path}
        if value.address is not None:
            row["memoryReference"] = f"{value.address:#06x}"
        sfr = self.inspector.image.chip.sfrs.get(value.name)
        if sfr is not None and sfr.fields and value.bits is None and value.address == sfr.address:
            row["value"] = f"{value.get():#06x}"
            row["variablesReference"] = self._new_reference(self._fields(value))
            row["namedVariables"] = len(sfr.fields)
        elif not value.text().startswith("<"):
            self._add_parts(row, value, path)
        return row

    def _add_parts(self, row: Row, value: Value, path: str) -> None:
        bare = value.type.bare
        members = list(parts_of(value.type))
        pointed = bare.kind == "pointer" and bare.target is not None and bare.target.bytes and value.get()
        if not members and not pointed:
            return

        whole = path if POSTFIX.fullmatch(path) else f"({path})"

        def rows() -> Iterator[tuple[str, Value | None, str]]:
            for part in value.parts():
                if bare.kind == "pointer":
                    yield f"*{value.name}", part, f"(*({path}))"
                elif bare.kind == "array":
                    yield part.name, part, f"{whole}{part.name}"
                else:
                    yield part.name, part, f"{whole}.{part.name}"

        row["variablesReference"] = self._new_reference(rows)
        row["indexedVariables" if bare.kind == "array" else "namedVariables"] = len(members) or 1


class SourceFiles:
    """Source files in the line table, and their paths on this host."""

    def __init__(self, inspector: Inspector, finder: SourceFinder) -> None:
        self._inspector: Final = inspector
        self._finder: Final = finder

    def path(self, file: str) -> Path:
        """Return the path of a file that the line table names; the name itself if the file does not exist."""
        return self._finder.find(file) or Path(file)

    def row(self, file: str) -> Row:
        """Return a source in the form of the protocol."""
        return {"name": Path(file).name, "path": str(self.path(file))}

    def all(self) -> list[Row]:
        """Return all source files of the program."""
        return [self.row(file) for file in sorted({row.file for row in self._inspector.image.lines.rows})]

    def lines(self, path: str) -> list[SourceLine]:
        """Return the rows of the line table for the file that a client calls `path`."""
        _, is_uri, rest = path.partition("://")
        requested = Path("/" + unquote(rest.partition("/")[2]) if is_uri else path)
        requested = requested.resolve() if requested.exists() else requested
        files = {row.file for row in self._inspector.image.lines.rows}
        own_files = {file for file in files if self.path(file) == requested}
        own_files = own_files or {file for file in files if Path(file).name == requested.name}
        return [row for row in self._inspector.image.lines.rows if row.file in own_files]

    def addresses(self, path: str, line: int) -> tuple[int, tuple[int, ...]]:
        """Return the first line with code at or after `line`, and its address in each function; 0 if there is none."""
        rows = self.lines(path)
        behind = sorted({row.line for row in rows if row.line >= line})
        if not behind:
            return 0, ()
        found: dict[int | None, int] = {}
        for row in rows:
            if row.line == behind[0]:
                start = self._inspector.function_start(row.start)
                place = row.start if row.start != start else self._inspector.prologue_end(start)
                found[start] = min(found.get(start, place), place)
        return behind[0], tuple(sorted(found.values()))


def disassembly_rows(inspector: Inspector, sources: SourceFiles, address: int, count: int, symbols: bool) -> list[Row]:
    """Return exactly `count` rows from `address`, one per program word.

    The first word of a line has its source line.
    """
    rows: list[Row] = []
    program, end = inspector.machine.program, inspector.image.chip.program["flash"].end
    second = address >= 2 and _words(inspector, address - 2) == 2
    for at in range(address, address + 2 * count, 2):
        if not 0 <= at < end:
            rows.append({"address": f"{max(at, 0):#08x}", "instruction": "", "presentationHint": "invalid"})
            continue
        item = None if second else inspector.processor.instruction(at)
        row: Row = {"address": f"{at:#08x}", "instructionBytes": f"{program.word(at):06x}",
                    "instruction": item[0] if item is not None else "" if second else ".pword"}  # fmt: skip
        line = inspector.image.lines.find(at)
        if line is not None and line.start == at:
            row |= {"location": sources.row(line.file), "line": line.line}
        if symbols and inspector.function_start(at) == at:
            row["symbol"] = inspector.function_name(at)
        rows.append(row)
        second = not second and _words(inspector, at) == 2
    return rows


def _words(inspector: Inspector, at: int) -> int:
    item = inspector.processor.instruction(at)
    return item[1] if item is not None else 1
