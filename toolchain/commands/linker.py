"""Command `ld`: link objects and libraries to an executable."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from toolchain.commands.parser import parser
from toolchain.errors import ToolError
from toolchain.files import read_bytes, write_outputs
from toolchain.link.command import add_options, link_files, link_options, output_files


def find_library(name: str, folders: list[str]) -> Path:
    """Return the path of the library for -lNAME; raise `ToolError` if no -L folder contains it."""
    for folder in folders:
        path = Path(folder) / f"lib{name}.a"
        if path.is_file():
            return path
    raise ToolError(f"cannot find lib{name}.a in {', '.join(folders) or 'any folder: give one with -L'}")


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    example = "python -m toolchain ld start.o main.o -L lib -lc -o firmware.elf -Map firmware.map"
    p = parser("ld", "Link ELF objects and archives for the dsPIC30F6014A.", example)
    p.add_argument("inputs", nargs="*", metavar="FILE", help="objects (.o) and archives (.a)")
    p.add_argument(
        "-o", dest="output", default="a.elf", help="executable; a name in .hex gives Intel HEX (default a.elf)"
    )
    p.add_argument("--hex", metavar="FILE", help="write Intel HEX as well")
    p.add_argument("-Map", "--Map", dest="map", metavar="FILE", help="write a link map with per-symbol sizes")
    p.add_argument("-L", dest="folders", action="append", default=[], metavar="DIR", help="search -l libraries here")
    p.add_argument("-l", dest="libraries", action="append", default=[], metavar="NAME", help="link libNAME.a")
    add_options(p)
    return p


def main(arguments: list[str]) -> int:
    """Link the files; return 0.  Raise `ToolError` with all errors."""
    options = options_of().parse_args(arguments)
    names = [*options.inputs, *(str(find_library(n, options.folders)) for n in options.libraries)]
    if not names:
        raise ToolError("no input files")
    linked = link_files([(name, read_bytes(name)) for name in names], link_options(options))
    for message in linked.messages:
        print(message, file=sys.stderr)
    if options.report_mem:
        from toolchain.link.mapfile import memory_report

        print(memory_report(linked))
    write_outputs(output_files(linked, Path(options.output), options.map, options.hex, options.memorysummary))
    return 0
