"""Link stage of the compiler driver: objects and archives to ELF or Intel HEX and a link map."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

from toolchain.elf.archive import open_archive
from toolchain.elf.model import ObjectFile
from toolchain.elf.read import read_object
from toolchain.errors import ToolError
from toolchain.files import read_bytes, write_outputs
from toolchain.frontend.options import CcOptions
from toolchain.frontend.short_double import MARK
from toolchain.link.command import link_options as link_settings
from toolchain.link.command import output_files, parse_link_words
from toolchain.link.levels import check_levels
from toolchain.link.link import link
from toolchain.link.mapfile import memory_report
from toolchain.link.options import LinkOptions
from toolchain.link.smartio import plain_name

RUNTIME_NAME = "run-time library"
DOUBLE_HELPER = re.compile(
    r"___(?:(?:add|sub|mul|div)df3|(?:eq|ne|lt|le|gt|ge|unord)df2|extendsfdf2|truncdfsf2|\w*df[sd]i|float\w*df)"
)
"""Names of the functions that code with 64-bit double calls."""
BUILT_IN_LIBRARIES = {"c", "m", "gcc", "pic30", "dsp"}
"""Names of libraries whose content is part of the run-time library; -l has no effect for them."""

# Patterns of conversions whose code is linked only if a format string has them (runtime/format.h, runtime/scan.h).
_FLAGS = rb"%[-+ #0]*(?:\d+|\*)?(?:\.(?:\d+|\*)?)?"
_WIDTH = rb"%\*?\d*"
FORMAT_PARTS = {
    re.compile(r"_v?(?:f|s|sn)?printf"): {
        "___format_double": re.compile(_FLAGS + rb"L?[fFeEgG]"),
        "___format_wide": re.compile(_FLAGS + rb"(?:ll|j)[diouxX]"),
    },
    re.compile(r"_v?[fs]?scanf"): {
        "___scan_double": re.compile(_WIDTH + rb"[lL]?[aAeEfFgG]"),
        "___scan_wide": re.compile(_WIDTH + rb"(?:ll|j)[diouxX]"),
    },
}


@dataclass
class LinkInput:
    """Input of the linker: run-time library, objects in order, archives."""

    runtime: bytes
    objects: list[tuple[str, bytes]] = field(default_factory=list)
    archives: list[tuple[str, bytes]] = field(default_factory=list)


def output_path(options: CcOptions) -> Path:
    """Path of the linked image."""
    return options.output or Path("a.elf")


def find_library(options: CcOptions, name: str) -> tuple[str, bytes] | None:
    """Archive for -lNAME; None if its content is part of the run-time library. Raise ToolError if no file is found."""
    for folder in options.library_dirs:
        path = folder / f"lib{name}.a"
        if path.is_file():
            return str(path), read_bytes(path)
    if name in BUILT_IN_LIBRARIES:
        return None
    searched = ", ".join(map(str, options.library_dirs)) or "no -L folder given"
    raise ToolError(f"cannot find lib{name}.a ({searched})")


def link_program(options: CcOptions, program: LinkInput) -> None:
    """Link and write all outputs or none. Raises ToolError that lists all errors."""
    objects = [read_object(content, name) for name, content in program.objects]
    archives = [open_archive(content, name) for name, content in program.archives]
    if program.runtime:
        archives.append(open_archive(program.runtime, RUNTIME_NAME))
    linked = link(objects, archives, link_options(options, objects))
    check_levels(linked.image)
    for message in [*linked.messages, *_mixed_doubles(objects)]:
        print(message, file=sys.stderr)
    words = parse_link_words(options.linker)
    if words.report_mem:
        print(memory_report(linked))
    write_outputs(output_files(linked, output_path(options), options.map_file, None, words.memorysummary))


def _mixed_doubles(objects: list[ObjectFile]) -> list[str]:
    """Return a warning if objects with 32-bit and with 64-bit double are linked together."""
    marked = [obj for obj in objects if any(symbol.name == MARK for symbol in obj.symbols)]
    wide = [obj for obj in objects if obj not in marked and any(DOUBLE_HELPER.fullmatch(s.name) for s in obj.symbols)]
    if not marked or not wide:
        return []
    return [
        f"{wide[0].name}: warning: its double has 64 bits, that of {marked[0].name} 32 bits: compile all files with or "
        "without -fshort-double"
    ]


def link_options(options: CcOptions, objects: list[ObjectFile]) -> LinkOptions:
    """Linker settings from the words of -Wl and -Xlinker; unused sections are removed by default."""
    result = link_settings(parse_link_words(["--gc-sections", *options.linker]))
    result.undefined += [*format_parts(objects), *uart_choice(objects)]
    result.chip = options.chip
    return result


def uart_choice(objects: list[ObjectFile]) -> list[str]:
    """Symbol of the library's standard streams with a choice of the UART, for a program that names __C30_UART."""
    return ["___stdio_uart"] if any(s.name == "___C30_UART" for obj in objects for s in obj.symbols) else []


def format_parts(objects: list[ObjectFile]) -> list[str]:
    """Symbols of the optional parts of printf and scanf that the program's constant strings need."""
    names = {plain_name(symbol.name, obj.name) for obj in objects for symbol in obj.symbols}
    strings = b"\0".join(bytes(s.data[::2]) for obj in objects for s in obj.sections if s.is_psv or s.is_ram)
    return [
        part
        for functions, parts in FORMAT_PARTS.items()
        if any(functions.fullmatch(name) for name in names)
        for part, pattern in parts.items()
        if pattern.search(strings)
    ]
