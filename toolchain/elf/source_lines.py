"""Source lines of an executable, for `objdump -S`; the DWARF reader is `emu.image.lines`."""

from __future__ import annotations

from emu.host.sources import source_lines
from emu.image.lines import LineTable, SourceLine
from toolchain.elf.model import Executable

__all__ = ["LineTable", "SourceLine", "SourceText", "lines_of"]


def lines_of(image: Executable) -> LineTable:
    """Return the line table of `image`; empty if the image contains no DWARF."""
    return LineTable({s.name: bytes(s.data) for s in image.sections if s.name.startswith(".debug_")})


class SourceText:
    """Lines of source files by their DWARF names; files that cannot be read have no lines."""

    def __init__(self) -> None:
        self._files: dict[str, list[str] | None] = {}

    def line(self, file: str, number: int) -> str | None:
        """Return the text of a line, None if the file or the line does not exist."""
        if file not in self._files:
            try:
                self._files[file] = source_lines(file)
            except OSError:
                self._files[file] = None
        text = self._files[file]
        return text[number - 1] if text is not None and 0 < number <= len(text) else None
