"""Command `hex`: convert an ELF executable to Intel HEX."""

from __future__ import annotations

import argparse
from pathlib import Path

from toolchain.commands.parser import parser
from toolchain.elf.read import read_executable
from toolchain.files import read_bytes, write_outputs
from toolchain.link.hexfile import hex_text


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    p = parser(
        "hex", "Convert an ELF executable, ours or XC16's, to Intel HEX.", "python -m toolchain hex firmware.elf"
    )
    p.add_argument("image")
    p.add_argument("-o", dest="output", default="", help="HEX file (default: image name with .hex)")
    for word in ("-a", "-u", "-v"):  # ignored: records are always sorted and have the chip's addresses
        p.add_argument(word, action="store_true", help=argparse.SUPPRESS)
    p.add_argument("-omf", default="elf", choices=("elf",), help=argparse.SUPPRESS)
    p.add_argument("-mdfp", default="", help=argparse.SUPPRESS)
    return p


def main(arguments: list[str]) -> int:
    """Convert the file; return 0."""
    options = options_of().parse_args(arguments)
    image = read_executable(read_bytes(options.image), options.image)
    write_outputs([(options.output or Path(options.image).with_suffix(".hex"), hex_text(image).encode())])
    return 0
