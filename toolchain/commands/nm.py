"""Command `nm`: print the symbol table."""

from __future__ import annotations

import argparse
import json

from toolchain.commands.parser import parser
from toolchain.elf import constants as c
from toolchain.elf.model import Bind, Home, Symbol
from toolchain.elf.read import is_object, read_executable, read_object
from toolchain.elf.symbols import is_named, symbol_sizes
from toolchain.files import read_bytes


def letter(symbol: Symbol) -> str:
    """Return nm's class letter of a symbol, in upper case if the symbol is global."""
    if symbol.home is Home.UNDEFINED:
        return "w" if symbol.bind is Bind.WEAK else "U"
    if symbol.home is Home.COMMON:
        return "C"
    if symbol.bind is Bind.WEAK:
        return "W"
    if symbol.home is Home.ABSOLUTE or symbol.section is None:
        kind = "a"
    elif symbol.section.is_psv:
        kind = "r"
    elif symbol.section.is_code:
        kind = "t"
    elif symbol.section.is_ram:
        kind = "b" if symbol.section.type == c.SHT_NOBITS else "d"
    else:
        kind = "n"
    return kind if symbol.bind is Bind.LOCAL else kind.upper()


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    p = parser(
        "nm", "List symbols: address, size in address units, class, name.", "python -m toolchain nm -S firmware.elf"
    )
    p.add_argument("files", nargs="+", metavar="FILE")
    p.add_argument("-n", "--numeric-sort", action="store_true", help="sort by address instead of name")
    p.add_argument("--size-sort", action="store_true", help="sort by size")
    p.add_argument("-S", "--print-size", action="store_true", help="show sizes")
    p.add_argument("-u", "--undefined-only", action="store_true")
    p.add_argument("-a", "--all", action="store_true", help="also compilers' local labels")
    p.add_argument("--json", action="store_true", help="machine-readable output")
    return p


def main(arguments: list[str]) -> int:
    """Print the symbols; return 0."""
    options = options_of().parse_args(arguments)
    listing = {name: _rows(name, options.all) for name in options.files}
    for name, rows in listing.items():
        if options.undefined_only:
            rows[:] = [row for row in rows if row[0].home is Home.UNDEFINED]
        rows.sort(key=lambda row: row[0].name)
        if options.numeric_sort:
            rows.sort(key=lambda row: row[0].value)
        elif options.size_sort:
            rows.sort(key=lambda row: row[1])
        if options.json:
            continue
        if len(listing) > 1:
            print(f"\n{name}:")
        for symbol, size in rows:
            value = " " * 8 if symbol.home is Home.UNDEFINED else f"{symbol.value:08x}"
            print(f"{value} {f'{size:08x} ' if options.print_size else ''}{letter(symbol)} {symbol.name}")
    if options.json:
        keys = ("name", "value", "size", "class")
        table = {
            n: [dict(zip(keys, (s.name, s.value, z, letter(s)), strict=True)) for s, z in r] for n, r in listing.items()
        }
        print(json.dumps(table, indent=1))
    return 0


def _rows(name: str, everything: bool) -> list[tuple[Symbol, int]]:
    data = read_bytes(name)
    relative = is_object(data)
    symbols = (read_object if relative else read_executable)(data, name).symbols
    sizes = dict(symbol_sizes(symbols, relative))
    return [(s, sizes.get(s, s.size)) for s in symbols if is_named(s) or (everything and s.name)]
