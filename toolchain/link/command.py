"""Link step of `ld` and the compiler driver: linker options, inputs by content, output files."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from emu.chips.chip import Chip, Region
from toolchain.arguments import definition, integer
from toolchain.device_names import DEFAULT, DEVICES, device
from toolchain.elf.archive import MAGIC, Archive, open_archive
from toolchain.elf.read import read_object
from toolchain.elf.write import executable_bytes
from toolchain.errors import ToolError
from toolchain.link.hexfile import hex_text
from toolchain.link.link import Linked, link
from toolchain.link.mapfile import map_text, memory_summary
from toolchain.link.options import MINIMUM_STACK, STACK_GUARD, LinkOptions, PartRegions

IGNORED_WORDS = (
    "--start-group", "--end-group", "-(", "-)",  # all libraries always form one group
    "--local-stack", "--no-local-stack",  # no effect: the stack always follows the data
    "--check-sections", "--no-check-sections",  # overlaps are always errors
    "--smart-io", "--no-smart-io",  # parts of printf are always linked by need of the format strings
    "--force-link", "--no-force-link", "--warn-common", "--cref", "--select-objects", "--no-select-objects",
    "--warn-section-align", "--no-warn-section-align", "--warn-once", "--no-undefined", "--relax", "--no-relax",
    "--strip-all", "-s", "--strip-debug", "-S", "--discard-all", "-x", "--trace", "-t", "--no-keep-memory",
    "--sort-common", "--ivt", "--verbose",
)  # fmt: skip
"""Options of Microchip's linker that are accepted without effect."""
DEVICE_SCRIPT = re.compile(r"p(30f\d{4}a?)\w*\.gld", re.IGNORECASE)
_NUMBERS = {"heap": 0xFFFF, "stack": 0xFFFF, "stackguard": 0xFFFF, "fill_upper": 0xFF}


def add_options(p: argparse.ArgumentParser) -> None:
    """Add the options of the linker, with the names of Microchip's linker (abi-elf.md §3.3)."""
    p.add_argument("-e", "--entry", default="__reset", help="start symbol (default __reset)")
    p.add_argument("--gc-sections", action="store_true", help="omit sections to which nothing refers")
    p.add_argument("--no-gc-sections", dest="gc_sections", action="store_false", help=argparse.SUPPRESS)
    p.add_argument("-u", "--undefined", action="append", default=[], metavar="SYM", help="keep and look for SYM")
    p.add_argument("--defsym", action="append", default=[], metavar="NAME=VALUE", help="define an absolute symbol")
    p.add_argument("--heap", type=integer, default=0, metavar="N", help="bytes of heap")
    p.add_argument("--stack", type=integer, default=MINIMUM_STACK, metavar="N", help="smallest stack accepted, bytes")
    p.add_argument("--stackguard", type=integer, default=STACK_GUARD, metavar="N", help="bytes kept above SPLIM")
    p.add_argument("--no-data-init", dest="data_init", action="store_false", help="leave out the .dinit table")
    p.add_argument("--data-init", dest="data_init", action="store_true", help=argparse.SUPPRESS)
    p.add_argument("--no-pack-data", dest="pack_data", action="store_false", help="two data bytes per .dinit word")
    p.add_argument("--pack-data", dest="pack_data", action="store_true", help=argparse.SUPPRESS)
    p.add_argument("--no-handles", dest="handles", action="store_false", help="no GOTO slots for function pointers")
    p.add_argument("--handles", dest="handles", action="store_true", help=argparse.SUPPRESS)
    p.add_argument("--no-isr", dest="isr", action="store_false", help="leave vectors without handler empty")
    p.add_argument("--isr", dest="isr", action="store_true", help=argparse.SUPPRESS)
    p.add_argument("--fill-upper", type=integer, default=0, metavar="BYTE", help="upper byte of data words in flash")
    p.add_argument("--debug-phantoms", action="store_true",
                   help="store debug information as XC16 does, every byte followed by a phantom octet")  # fmt: skip
    p.add_argument("--part", metavar="FIRST-LAST,FIRST-LAST",
                   help="link what another image calls, into these addresses of program memory and RAM alone: without"
                        " vectors, reset and stack, constants in RAM")  # fmt: skip
    p.add_argument("--report-mem", action="store_true", help="print memory use")
    p.add_argument("--memorysummary", metavar="FILE", help="write memory use as the XML that MPLAB X shows")
    p.add_argument("-T", "--script", action="append", default=[], metavar="FILE",
                   help="accepted for the device's own script, p30F6014A.gld: its memory map is built in")  # fmt: skip
    p.add_argument("-D", dest="macros", action="append", default=[], help=argparse.SUPPRESS)  # of linker scripts
    p.add_argument("-mdfp", action="append", default=[], help=argparse.SUPPRESS)
    for word in IGNORED_WORDS:
        p.add_argument(word, action="store_true", help=argparse.SUPPRESS)
    p.add_argument("-p", "--processor", default=DEFAULT, metavar="NAME",
                   help=f"the device: {' or '.join(DEVICES)} (default {DEFAULT})")  # fmt: skip


def link_options(options: argparse.Namespace) -> LinkOptions:
    """Return the linker's options from parsed arguments; raise `ToolError` for values out of range."""
    for name, most in _NUMBERS.items():
        if not 0 <= getattr(options, name) <= most:
            raise ToolError(f"--{name.replace('_', '-')} {getattr(options, name)} is outside 0..{most}")
    chip = device(options.processor)
    for script in options.script:
        named = DEVICE_SCRIPT.fullmatch(Path(script).name)
        if named is None or device(named[1]) is not chip:
            raise ToolError(
                f"linker script '{script}' is not used here: the memory map of the device is built in; "
                f"place objects with __attribute__((address(N))), define symbols with --defsym"
            )
    return LinkOptions(
        entry=options.entry,
        gc_sections=options.gc_sections,
        heap=options.heap,
        stack=options.stack,
        stack_guard=options.stackguard,
        data_init=options.data_init,
        pack_data=options.pack_data,
        handles=options.handles,
        isr=options.isr,
        fill_upper=options.fill_upper,
        debug_phantoms=options.debug_phantoms,
        undefined=options.undefined,
        define=dict(map(definition, options.defsym)),
        chip=chip,
        part=None if options.part is None else _part(options.part, chip),
    )


def _part(text: str, chip: Chip) -> PartRegions:
    number = r"(0x[0-9a-fA-F]+|\d+)"
    found = re.fullmatch(f"{number}-{number},{number}-{number}", text)
    if found is None:
        raise ToolError(
            f"--part {text}: expected first and last addresses of program memory and RAM, as 0xF800-0xFFFF,0x800-0x9FF"
        )
    first, last, lowest, highest = (int(word, 0) for word in found.groups())
    regions = Region("part of program", first, last + 1), Region("part of RAM", lowest, highest + 1)
    for region, whole in zip(regions, (chip.program["program"], chip.data["ram"]), strict=True):
        if not whole.start <= region.start < region.end <= whole.end or region.start % 2 or region.end % 2:
            raise ToolError(
                f"--part {text}: {region.start:#x}-{region.end - 1:#x} are no whole words of {whole.name} memory,"
                f" {whole.start:#x}-{whole.end - 1:#x}"
            )
    return PartRegions(*regions)


class _Words(argparse.ArgumentParser):
    """Argument parser that raises `ToolError` instead of exiting."""

    def error(self, message: str) -> NoReturn:
        raise ToolError(f"linker option: {message} (see `python -m toolchain ld --help`)")


def parse_link_words(words: Sequence[str]) -> argparse.Namespace:
    """Parse the linker options of -Wl and -Xlinker; raise `ToolError` for an unknown option."""
    p = _Words(prog="cc -Wl", allow_abbrev=False, add_help=False)
    add_options(p)
    return p.parse_args(list(words))


def link_files(inputs: Sequence[tuple[str, bytes]], options: LinkOptions) -> Linked:
    """Link files given as (name, content), objects and archives mixed.  Raises `ToolError`."""
    objects = [read_object(data, name) for name, data in inputs if data[: len(MAGIC)] != MAGIC]
    archives: list[Archive] = [open_archive(data, name) for name, data in inputs if data[: len(MAGIC)] == MAGIC]
    return link(objects, archives, options)


def output_files(
    linked: Linked,
    output: Path,
    map_file: str | Path | None = None,
    hex_file: str | Path | None = None,
    summary_file: str | Path | None = None,
) -> list[tuple[str | Path, bytes]]:
    """Return (path, content) of all output files of a link; an `output` that ends in .hex is Intel HEX, not ELF."""
    is_hex = output.suffix.lower() in (".hex", ".ihex")
    content = hex_text(linked.image).encode() if is_hex else executable_bytes(linked.image)
    files: list[tuple[str | Path, bytes]] = [(output, content)]
    if hex_file:
        files.append((hex_file, hex_text(linked.image).encode()))
    if map_file:
        files.append((map_file, map_text(linked).encode()))
    if summary_file:
        files.append((summary_file, memory_summary(linked, output.name).encode()))
    return files
