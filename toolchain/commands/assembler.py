"""Command `as`: assemble one source to one object."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from emu.host.files import is_standard
from toolchain.arguments import definition
from toolchain.asm.assemble import assemble
from toolchain.asm.state import Options
from toolchain.commands.parser import parser
from toolchain.device_names import DEFAULT, DEVICES, device
from toolchain.elf.write import object_bytes
from toolchain.errors import ToolError
from toolchain.files import read_text, write_outputs


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    p = parser(
        "as", "Assemble a source in pic30-as syntax to an ELF object.", "python -m toolchain as start.s -o start.o"
    )
    p.add_argument("source", help="assembly source, - for standard input")
    p.add_argument("-o", dest="output", default="", help="object file (default: source name with .o)")
    p.add_argument("-I", dest="include", action="append", default=[], metavar="DIR", help="search .include files here")
    p.add_argument("--defsym", action="append", default=[], metavar="NAME=VALUE", help="define an absolute symbol")
    p.add_argument("--relax", action="store_true", help="shorten CALL and GOTO within a section")
    p.add_argument("-g", dest="debug", action="store_true", help="write a DWARF line table for this source")
    p.add_argument("--debug-prefix-map", action="append", default=[], metavar="OLD=NEW", type=_pair,
                   help="paths that begin with OLD are recorded as NEW")  # fmt: skip
    p.add_argument("-p", dest="part", default=DEFAULT, help=f"processor: {' or '.join(DEVICES)} (default {DEFAULT})")
    p.add_argument("-omf", default="elf", choices=("elf",), help=argparse.SUPPRESS)
    p.add_argument("-mdfp", default="", help=argparse.SUPPRESS)
    return p


def main(arguments: list[str]) -> int:
    """Assemble a source; return 0.  Raise `ToolError` with all errors."""
    options = options_of().parse_args(arguments)
    chip = device(options.part)
    name, text = "<stdin>" if is_standard(options.source) else options.source, read_text(options.source)
    output = options.output or ("a.out" if is_standard(options.source) else str(Path(name).with_suffix(".o").name))
    if Path(output) == Path(name):
        raise ToolError(f"the output {output} would overwrite the source")
    asm_options = Options(include=options.include, define=dict(map(definition, options.defsym)), relax=options.relax,
                          debug=options.debug, chip=chip, prefix_map=options.debug_prefix_map)  # fmt: skip
    obj, messages = assemble(text, name, asm_options)
    for message in messages:
        print(message, file=sys.stderr)
    write_outputs([(output, object_bytes(obj))])
    return 0


def _pair(text: str) -> tuple[str, str]:
    old, equals, new = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"{text!r}: expected OLD=NEW")
    return old, new
