"""The link stage of the compiler driver: native objects and archives in; ELF or HEX, and a map, out."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

from toolchain.cc_options import CcOptions
from toolchain.elf.model import ObjectFile
from toolchain.elf.read import read_object
from toolchain.elf.write import executable_bytes
from toolchain.errors import ToolError
from toolchain.files import read_bytes, write_outputs
from toolchain.link.archive import open_archive
from toolchain.link.link import Linked, link
from toolchain.link.options import LinkOptions

RUNTIME_NAME = "run-time library"
BUILT_IN_LIBRARIES = {"c", "m", "gcc", "pic30", "dsp"}
"""Names other toolchains use for what our run-time library holds; linking them is a no-op here."""

VALUE_WORDS = {"defsym", "heap", "stack", "stackguard", "u", "undefined", "entry", "e", "fill-upper"}

# printf conversions whose code is linked only when a format string mentions them (runtime/format.h).
_FLAGS = rb"%[-+ #0]*(?:\d+|\*)?(?:\.(?:\d+|\*)?)?"
FORMAT_PARTS = {
    "___format_double": re.compile(_FLAGS + rb"L?[fFeEgG]"),
    "___format_wide": re.compile(_FLAGS + rb"(?:ll|j)[diouxX]"),
}
FORMATTERS = re.compile(r"_v?[fs]?n?printf")


@dataclass
class Program:
    """What the compile stages hand to the linker: the library's bytes, native objects in order, archives."""

    runtime: bytes
    objects: list[tuple[str, bytes]] = field(default_factory=list)
    archives: list[tuple[str, bytes]] = field(default_factory=list)


def output_path(options: CcOptions) -> Path:
    """Where the linked image goes."""
    return options.output or Path("a.elf")


def find_library(options: CcOptions, name: str) -> tuple[str, bytes] | None:
    """Archive named by -l, or None for one whose content is part of the run-time library."""
    for folder in options.library_dirs:
        path = folder / f"lib{name}.a"
        if path.is_file():
            return str(path), read_bytes(path)
    if name in BUILT_IN_LIBRARIES:
        return None
    searched = ", ".join(map(str, options.library_dirs)) or "no -L folder given"
    raise ToolError(f"cannot find lib{name}.a ({searched})")


def link_program(options: CcOptions, program: Program) -> None:
    """Link and write the outputs, all or none. Raises ToolError listing everything that is wrong."""
    objects = [read_object(content, name) for name, content in program.objects]
    archives = [open_archive(content, name) for name, content in program.archives]
    if program.runtime:
        archives.append(open_archive(program.runtime, RUNTIME_NAME))
    linked = link(objects, archives, link_options(options, objects))
    for message in linked.messages:
        print(message, file=sys.stderr)
    _write(options, linked)


def _write(options: CcOptions, linked: Linked) -> None:
    from toolchain.link.hexfile import hex_text

    output = output_path(options)
    is_hex = output.suffix.lower() in (".hex", ".ihex")
    content = hex_text(linked.image).encode() if is_hex else executable_bytes(linked.image)
    outputs: list[tuple[str | Path, bytes]] = [(output, content)]
    if options.map_file is not None:
        from toolchain.link.mapfile import map_text

        outputs.append((options.map_file, map_text(linked).encode()))
    write_outputs(outputs)


def link_options(options: CcOptions, objects: list[ObjectFile]) -> LinkOptions:
    """Linker settings from -Wl and -Xlinker words, spelled as Microchip's linker spells them (abi-elf.md §3.3)."""
    result = LinkOptions(gc_sections=True)
    result.undefined += format_parts(objects)
    words = iter(options.linker)
    for word in words:
        name, _, value = word.lstrip("-").partition("=")
        if (
            name in ("defsym", "heap", "stack", "stackguard", "u", "undefined", "entry", "e", "fill-upper")
            and not value
        ):
            value = next(words, "")
        if not _apply(result, name, value):
            raise ToolError(f"unknown linker option '{word}'")
    return result


def _apply(result: LinkOptions, name: str, value: str) -> bool:
    switches = {
        "gc-sections": ("gc_sections", True), "no-gc-sections": ("gc_sections", False),
        "no-data-init": ("data_init", False), "data-init": ("data_init", True),
        "pack-data": ("pack_data", True), "no-pack-data": ("pack_data", False),
        "handles": ("handles", True), "no-handles": ("handles", False), "isr": ("isr", True), "no-isr": ("isr", False),
    }  # fmt: skip
    numbers = {"heap": "heap", "stack": "stack", "stackguard": "stack_guard", "fill-upper": "fill_upper"}
    if name in switches:
        setattr(result, *switches[name])
    elif name in numbers:
        setattr(result, numbers[name], _number(name, value))
    elif name in ("u", "undefined"):
        result.undefined.append(value)
    elif name in ("e", "entry"):
        result.entry = value
    elif name == "defsym":
        symbol, _, number = value.partition("=")
        result.define[symbol] = _number(name, number)
    else:
        return name in ("report-mem", "warn-common", "cref")
    return True


def _number(name: str, value: str) -> int:
    try:
        return int(value, 0)
    except ValueError:
        raise ToolError(f"linker option --{name} needs a number, not '{value}'") from None


def format_parts(objects: list[ObjectFile]) -> list[str]:
    """Symbols of the printf parts that the program's constant strings ask for; none when nothing formats."""
    wanted: list[str] = []
    uses = [obj for obj in objects if any(FORMATTERS.fullmatch(symbol.name) for symbol in obj.symbols)]
    if not uses:
        return wanted
    strings = b"\0".join(bytes(s.data[::2]) for obj in objects for s in obj.sections if s.is_psv or s.is_ram)
    for symbol, pattern in FORMAT_PARTS.items():
        if pattern.search(strings):
            wanted.append(symbol)
    return wanted
