"""What names in notes and on the command line mean: addresses of functions, variables and registers."""

from __future__ import annotations

from collections.abc import Set as AbstractSet

from emu.chips.chip import Chip
from toolchain.bounds.annotations.notes import Note
from toolchain.bounds.annotations.sources import Sources
from toolchain.elf.model import Bind, Executable, Symbol
from toolchain.errors import ToolError


class Names:
    """Names of one image, in C or assembly spelling; `file.c/name` is one of that file."""

    def __init__(self, image: Executable, sources: Sources, chip: Chip, entries: AbstractSet[int]) -> None:
        self.sources, self.chip, self.entries = sources, chip, entries
        self._symbols: dict[str, list[Symbol]] = {}
        for symbol in image.symbols:
            name, dot, number = symbol.name.rpartition(".")
            plain = name if dot and number.isdigit() else symbol.name  # static ones of several files
            self._symbols.setdefault(plain, []).append(symbol)

    def find(self, name: str, note: Note | None = None) -> int | None:
        """The address of a name, as the file of a note sees it; None if there is none, or all its calls are inlined.

        Raises `ToolError` where it is several, or static in another file.
        """
        folder, _, plain = name.rpartition("/")
        symbols = self._symbols.get("_" + plain) or self._symbols.get(plain) or []
        if folder:
            files = set(self.sources.files(folder))
            symbols = [symbol for symbol in symbols if self.file(symbol) in files]
        elif note is not None:
            own = self.sources.of(note)
            here = [symbol for symbol in symbols if own is not None and self.file(symbol) == own]
            seen = here or [s for s in symbols if s.bind is not Bind.LOCAL or not self.file(s)]
            if symbols and not seen and (own is None or not self.sources.declares(own, plain)):
                where = " or ".join(sorted(map(self._spelled, symbols)))
                raise ToolError(f"{note.place}: no {name} can be seen from there; there is {where}")
            symbols = seen
        found = {symbol.value for symbol in symbols}
        if len(found) > 1:
            where = f"{note.place}: " if note is not None else ""
            raise ToolError(f"{where}{name} is several: say {' or '.join(sorted(map(self._spelled, symbols)))}")
        if found:
            return found.pop()
        sfr = None if folder else self.chip.sfrs.get(name)
        return None if sfr is None else sfr.address

    def file(self, symbol: Symbol) -> str:
        """The file a function or variable is defined in; "" where it is not known."""
        known = self.sources.functions.get(symbol.value)
        if known is not None and symbol.value in self.entries:
            return known[0]
        return self.sources.lines.files.get(symbol.value, "") or self.sources.at(symbol.value)[0]

    def _spelled(self, symbol: Symbol) -> str:
        return f"{self.file(symbol)}/{symbol.name.partition('.')[0].removeprefix('_')}"
