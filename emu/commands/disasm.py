"""`emu disasm`: print a firmware image as assembly, with symbols and source lines if available."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator

from emu.commands.image_option import add_chip_option, image_of
from emu.debug.disassembly import Item
from emu.debug.dwarf.units import debug_of
from emu.debug.inlining import missing_function
from emu.dspic30f.isa.flow import PC_MASK
from emu.host.command import CommandError, Parser
from emu.host.exit_status import DONE
from emu.host.sources import SourceFinder, source_lines
from emu.image.model import Image
from emu.instruments.disassembly import items


def parser() -> Parser:
    made = Parser(
        "disasm",
        "Print a firmware image as assembly, with symbols and source lines if available.",
        "emu disasm firmware.elf --from main --source",
    )
    made.add_argument("image", metavar="IMAGE", help="ELF executable or Intel HEX file")
    add_chip_option(made)
    made.add_argument(
        "--from", dest="start", metavar="SYM|ADDR", help="first address; a function name alone shows the whole function"
    )
    made.add_argument("--to", dest="end", metavar="SYM|ADDR", help="end address (exclusive)")
    made.add_argument("--source", action="store_true", help="show the text of source lines, if the files exist")
    made.add_argument("--json", action="store_true", help="print one JSON object per instruction")
    return made


def run(options: argparse.Namespace) -> int:
    """Run the command. Return 0 if printed, 2 for bad input."""
    image = image_of(options)
    start, end = _range(image, options.start, options.end)
    for warning in image.warnings:
        print(f"emu disasm: warning: {image.path}: {warning}", file=sys.stderr)
    found = items(image, start, end)
    sources = _Sources(options.source, options.image)
    lines = _json(image, found) if options.json else listing(image, found, sources)
    for line in lines:
        print(line)
    return DONE


def _range(image: Image, start: str | None, end: str | None) -> tuple[int, int]:
    """Return the address range to disassemble. A function name alone selects the whole function."""
    flash = image.chip.program["flash"]
    first = flash.start if start is None else code_address(image, start)
    if end is not None:
        last = code_address(image, end)
        if last <= first:
            raise CommandError(f"--to {last:#x} must be above the first address, {first:#x}")
        return first, last
    symbol = image.symbols.find(start) if start is not None else None
    return first, first + symbol.size if symbol is not None and symbol.size else flash.end


def code_address(image: Image, text: str) -> int:
    """Return the program address denoted by a symbol's name or an even number. Raises CommandError for other text."""
    symbol = image.symbols.find(text)
    if symbol is not None:
        if symbol.space not in ("code", "absolute"):
            raise CommandError(f"{text!r} is not code; it is in {symbol.space} memory")
        return symbol.address
    try:
        address = int(text, 0)
    except ValueError:
        reason = missing_function(debug_of(image), text) or "not in the program, and not an address"
        raise CommandError(f"{image.path}: {text!r}: {reason}") from None
    if address & 1 or not 0 <= address <= PC_MASK:
        raise CommandError(f"{text} is not a program address; expected an even number, 0 to {PC_MASK:#x}")
    return address


def listing(image: Image, found: Iterator[Item], sources: _Sources) -> Iterator[str]:
    """Yield the listing as text lines."""
    line = None
    for item in found:
        labels = image.symbols.labels(item.address)
        if labels:
            yield ""
            yield from (f"{item.address:06x} <{symbol.name}>:" for symbol in labels)
        here = image.lines.find(item.address)
        if here is not None and (line is None or (here.file, here.line) != (line.file, line.line)):
            yield f"{here}{sources.text(here.file, here.line)}"
        line = here
        words = " ".join(f"{word:06x}" for word in item.words)
        yield f"  {item.address:06x}  {words:13}  {item.text}"


def _json(image: Image, found: Iterator[Item]) -> Iterator[str]:
    for item in found:
        line = image.lines.find(item.address)
        yield json.dumps(
            {
                "address": item.address,
                "words": list(item.words),
                "text": item.text,
                "symbol": image.symbols.text(item.address) if image.symbols.code(item.address) else None,
                "line": str(line) if line else None,
            }
        )


class _Sources:
    """Lines of source files. Each file is read once; a missing file has no lines."""

    def __init__(self, wanted: bool, image: str) -> None:
        self.wanted = wanted
        self._finder = SourceFinder(image)
        self._files: dict[str, list[str]] = {}

    def text(self, file: str, line: int) -> str:
        if not self.wanted:
            return ""
        if file not in self._files:
            found = self._finder.find(file)
            self._files[file] = source_lines(found) if found is not None else []
        lines = self._files[file]
        return f": {lines[line - 1].strip()}" if 0 < line <= len(lines) else ""
