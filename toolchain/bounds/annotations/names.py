"""Resolution of names in annotations and on the command line to addresses."""

from __future__ import annotations

from collections.abc import Set as AbstractSet

from emu.chips.chip import Chip
from toolchain.elf.annotations import Annotation
from toolchain.elf.constants import STT_OBJECT
from toolchain.elf.model import Bind, Executable, Symbol
from toolchain.elf.source_map import SourceMap
from toolchain.errors import ToolError


class NameResolver:
    """Names of one image, in C or assembly spelling; `file.c/name` is the static name of that file."""

    def __init__(self, image: Executable, sources: SourceMap, chip: Chip, entries: AbstractSet[int]) -> None:
        self.sources, self.chip, self.entries = sources, chip, entries
        self._symbols: dict[str, list[Symbol]] = {}
        for symbol in image.symbols:
            name, dot, number = symbol.name.rpartition(".")
            plain = name if dot and number.isdigit() else symbol.name  # the number distinguishes statics of files
            self._symbols.setdefault(plain, []).append(symbol)

    def find(self, name: str, annotation: Annotation | None = None) -> int | None:
        """Return the address of a name in the scope of an annotation's file; None if unknown, or inlined everywhere.

        Raises `ToolError` for an ambiguous name, or one that is static in another file.
        """
        folder, _, plain = name.rpartition("/")
        symbols = self._symbols.get("_" + plain) or self._symbols.get(plain) or []
        if folder:
            files = set(self.sources.matching_files(folder))
            symbols = [symbol for symbol in symbols if self.file(symbol) in files]
        elif annotation is not None:
            own = self.sources.file_of(annotation)
            here = [symbol for symbol in symbols if own is not None and self.file(symbol) == own]
            seen = here or [s for s in symbols if s.bind is not Bind.LOCAL or not self.file(s)]
            if symbols and not seen and (own is None or not self.sources.declares(own, plain)):
                where = " or ".join(sorted(map(self._qualified, symbols)))
                raise ToolError(f"{annotation.place}: {name} is not visible in this file; candidates: {where}")
            symbols = seen
        found = {symbol.value for symbol in symbols}
        if len(found) > 1:
            where = f"{annotation.place}: " if annotation is not None else ""
            raise ToolError(f"{where}{name} is ambiguous: write {' or '.join(sorted(map(self._qualified, symbols)))}")
        if found:
            return found.pop()
        sfr = None if folder else self.chip.sfrs.get(name)
        return None if sfr is None else sfr.address

    def file(self, symbol: Symbol) -> str:
        """Return the file that defines a function or variable, "" if unknown."""
        if symbol.type == STT_OBJECT:  # its address may equal that of a function: data and code are two spaces
            return self.sources.lines.files.get(symbol.value, "")
        known = self.sources.functions.get(symbol.value)
        if known is not None and symbol.value in self.entries:
            return known[0]
        return self.sources.lines.files.get(symbol.value, "") or self.sources.line_of(symbol.value)[0]

    def _qualified(self, symbol: Symbol) -> str:
        return f"{self.file(symbol)}/{symbol.name.partition('.')[0].removeprefix('_')}"
