"""Attribution of a cycle difference to source lines, by alignment of the old and the new instructions.

Input: a number with its cycles by function and instruction, and the instructions of both images. Instructions are
aligned by their text without registers and addresses. An aligned instruction that takes as many cycles as before is not
to blame, whatever line the compiler assigns to it now.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from difflib import SequenceMatcher
from functools import cached_property
from pathlib import Path
from typing import Final

from emu.debug.dwarf.units import debug_of
from emu.host.sources import SourceFinder, source_lines
from emu.image.model import Image
from emu.instruments.disassembly import items
from emu.kernel_metrics.baseline import Where
from emu.kernel_metrics.meter import BEFORE_WINDOW
from emu.kernel_metrics.observation import EXCEPTION_ENTRY
from emu.kernel_metrics.owners import owner_of_module

LINES_SHOWN: Final = 4
"""Maximum number of source lines shown for a number that grew."""
SPECIAL: Final = {BEFORE_WINDOW: "(before the first instruction)", EXCEPTION_ENTRY: "(exception entry)"}
"""Parts of a window that belong to no instruction, by their pseudo-address."""
_REGISTER: Final = re.compile(r"\b[wW]\d{1,2}\b")
_CODE_OFFSET: Final = re.compile(r"(?<=[\w.])\+0x[0-9a-f]+")
_LITERAL: Final = re.compile(r"#(0x[0-9a-f]+)")
_C_COMMENT: Final = re.compile(r"/\*.*?(\*/|$)|//.*")
_ASSEMBLY_COMMENT: Final = re.compile(r"/\*.*?(\*/|$)|//.*|;.*")


class SourceLines:
    """Text of the source lines of an image, if the files can be read."""

    def __init__(self, image_path: str) -> None:
        self._finder: Final = SourceFinder(image_path)
        self._files: Final[dict[str, list[str]]] = {}

    def text(self, file: str, line: int) -> str:
        """Return the code of a line without comments; empty if it cannot be read."""
        lines = self._lines(file)
        return without_comments(lines[line - 1], file) if 0 < line <= len(lines) else ""

    def _lines(self, file: str) -> list[str]:
        if file not in self._files:
            path = self._finder.find(file)
            self._files[file] = source_lines(path) if path is not None else []
        return self._files[file]


def without_comments(line: str, file: str) -> str:
    """Return the code of a source line without comments and with normalised white space."""
    comment = _ASSEMBLY_COMMENT if file.endswith((".s", ".S")) else _C_COMMENT
    return " ".join(comment.sub("", line).split())


def short(file: str) -> str:
    """Return a path without the folders that differ between checkouts."""
    for folder in ("/openswarm/", "/apps/", "/runtime/"):
        _, found, rest = f"/{file}".rpartition(folder)
        if found:
            return rest if folder == "/openswarm/" else folder[1:] + rest
    return file if not file.startswith("/") else Path(file).name


class CodeListing:
    """The instructions of an image by function, and their source lines."""

    def __init__(self, image: Image) -> None:
        self._image: Final = image
        self._sources: Final = SourceLines(image.path)
        self._functions: Final[dict[str, list[tuple[int, str]]]] = {}

    @cached_property
    def _starts(self) -> list[int]:
        symbols = self._image.symbols
        return sorted({s.address for s in symbols.all if s.space == "code" and s.names_content})

    def by_instruction(self, addresses: Mapping[int, int]) -> dict[str, dict[str, int]]:
        """Convert cycles by instruction address to cycles by function and instruction index."""
        found: dict[str, dict[str, int]] = {}
        for address, cycles in sorted(addresses.items()):
            if address in SPECIAL:
                found.setdefault(SPECIAL[address], {})["0"] = cycles
                continue
            name = self._name(address)
            index = next((n for n, (at, _) in enumerate(self._listing(name)) if at == address), 0)
            found.setdefault(name, {})[str(index)] = cycles
        return found

    def code(self, functions: Iterable[str]) -> dict[str, tuple[str, ...]]:
        """Return the normalised instructions of functions, for a baseline."""
        return {name: tuple(text for _, text in self._listing(name)) for name in sorted(functions) if name[0] != "("}

    def place(self, function: str, index: int) -> str:
        """Return the source line of an instruction as `src/main.c:12: code`, or the function's name.

        Code that was inlined from another owner's file belongs to the line that calls it.
        """
        listing = self._listing(function) if function[0] != "(" else []
        line = self._image.lines.find(listing[index][0]) if index < len(listing) else None
        if line is None:
            return function
        file, number = self._calling_line(listing[index][0], line.file, line.line)
        text = self._sources.text(file, number)
        return f"{short(file)}:{number}" + (f": {text}" if text else "")

    def _calling_line(self, pc: int, file: str, line: int) -> tuple[str, int]:
        scope = debug_of(self._image).function(pc)
        if scope is None:
            return file, line
        owner = owner_of_module(scope.file)
        for inner in reversed(scope.chain(pc)):
            if owner_of_module(file) == owner:
                break
            if inner.kind == "inlined" and inner.call_line:
                file, line = inner.call_file, inner.call_line
        return file, line

    def _text(self, text: str) -> str:
        """Return a normalised instruction, with `#address` for a literal that is an address of the image."""
        literal = _LITERAL.search(text)
        if literal is not None and self._is_address(int(literal[1], 16)):
            text = text.replace(literal[0], "#address")
        return normalised(text)

    def _is_address(self, value: int) -> bool:
        symbols = self._image.symbols
        return bool(symbols.labels(value)) or symbols.variable_at(value) is not None

    def _name(self, address: int) -> str:
        symbol = self._image.symbols.code(address)
        return symbol[0].name if symbol is not None else f"{address:#08x}"

    def _listing(self, name: str) -> list[tuple[int, str]]:
        if name not in self._functions:
            symbol = next((s for s in self._image.symbols.all if s.name == name and s.space == "code"), None)
            found: list[tuple[int, str]] = []
            if symbol is not None:
                end = next((start for start in self._starts if start > symbol.address), symbol.address)
                end = symbol.address + symbol.size if symbol.size else end
                found = [(item.address, self._text(item.text)) for item in items(self._image, symbol.address, end)]
            self._functions[name] = found
        return self._functions[name]


def normalised(text: str) -> str:
    """Return the text of an instruction without register numbers and distances in code."""
    return _CODE_OFFSET.sub("", _REGISTER.sub("w", text))


def grown_lines(
    old: Where, old_code: Mapping[str, tuple[str, ...]], new: Where, listing: CodeListing
) -> list[tuple[str, int]]:
    """Return the source lines to which the additional cycles belong.

    Lines with new or changed instructions come first: an unchanged line that takes longer does so because of them.
    """
    more: Counter[str] = Counter()
    is_changed: Counter[str] = Counter()
    new_code = listing.code(new)
    for function, now in new.items():
        before = old.get(function, {})
        is_code = function[0] != "("
        partner, changed = aligned(old_code.get(function, ()), new_code[function]) if is_code else ({}, set())
        for index, cycles in now.items():
            place = listing.place(function, int(index))
            mine = partner.get(int(index)) if is_code else int(index)
            more[place] += cycles - (before.get(str(mine), 0) if mine is not None else 0)
            is_changed[place] += int(index) in changed
    grown = {place: cycles for place, cycles in more.items() if cycles > 0 or is_changed[place]}
    ranked = sorted(grown.items(), key=lambda item: (not is_changed[item[0]], -item[1], item[0]))
    return ranked[:LINES_SHOWN]


def aligned(old: tuple[str, ...], new: tuple[str, ...]) -> tuple[dict[int, int | None], set[int]]:
    """Return the partner in `old` of each instruction of `new`, None for an inserted one; and the changed ones."""
    partner: dict[int, int | None] = dict.fromkeys(range(len(new)))
    changed: set[int] = set()
    for what, a, b, c, d in SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if what != "equal":
            changed.update(range(c, d))
        partner.update(zip(range(c, d), range(a, b), strict=False))
    return partner, changed
