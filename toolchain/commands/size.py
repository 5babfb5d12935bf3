"""Command `size`: flash and RAM use of objects and executables."""

from __future__ import annotations

import argparse
import json

from emu.image.elf_facts import SectionFlag
from toolchain.commands.parser import parser
from toolchain.elf import constants as c
from toolchain.elf.model import Section
from toolchain.elf.read import is_object, read_executable, read_object
from toolchain.files import read_bytes
from toolchain.link import memory

CONFIG_SECTIONS = {name for word in memory.CONFIG_SECTIONS for name in (word, word.removesuffix(".sec"))}
"""Sections of configuration words, which have code flags but take no flash (abi-elf.md §6.6)."""


def totals(sections: list[Section]) -> dict[str, int]:
    """Return bytes of code, const (both in flash, three per word), eeprom, data and bss (RAM)."""
    result = dict.fromkeys(("code", "const", "eeprom", "data", "bss"), 0)
    for section in sections:
        words = (section.units + 1) // 2
        if section.is_psv:
            result["const"] += words * 3
        elif section.is_eedata:
            result["eeprom"] += section.units
        elif section.is_code and section.flags & SectionFlag.ALLOC and section.name not in CONFIG_SECTIONS:
            result["code"] += words * 3
        elif section.is_ram:
            result["bss" if section.type == c.SHT_NOBITS else "data"] += section.units
    return result


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    p = parser(
        "size", "Show flash bytes (three per instruction word) and RAM bytes.", "python -m toolchain size firmware.elf"
    )
    p.add_argument("files", nargs="+", metavar="FILE")
    p.add_argument("-A", "--sections", action="store_true", help="one line per section")
    p.add_argument("--json", action="store_true", help="machine-readable output")
    return p


def main(arguments: list[str]) -> int:
    """Print a table or JSON; return 0."""
    options = options_of().parse_args(arguments)
    rows: dict[str, dict[str, int]] = {}
    detail: dict[str, list[Section]] = {}
    for name in options.files:
        data = read_bytes(name)
        sections = (read_object if is_object(data) else read_executable)(data, name).sections
        detail[name] = [s for s in sections if s.flags & SectionFlag.ALLOC and s.units]
        rows[name] = totals(sections)
    if options.json:
        print(json.dumps(rows, indent=1))
    elif options.sections:
        for name, sections in detail.items():
            print(f"{name}:\n{'section':20} {'address':>8} {'units':>7} {'bytes':>7}")
            for s in sections:
                used = (s.units + 1) // 2 * 3 if s.is_code or s.is_psv else s.units
                print(f"{s.name:20} {s.address:#08x} {s.units:7} {used:7}")
    else:
        columns = ("code", "const", "eeprom", "data", "bss")
        print("".join(f"{column:>8}" for column in columns) + "   flash     ram  file")
        for name, row in rows.items():
            flash, ram = row["code"] + row["const"], row["data"] + row["bss"]
            print("".join(f"{row[column]:8}" for column in columns) + f"{flash:8}{ram:8}  {name}")
    return 0
