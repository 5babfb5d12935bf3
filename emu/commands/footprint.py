"""`emu footprint`: what a firmware image costs in ROM and RAM, by part, source file and symbol."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import Any

from emu.command import EXIT_OK, CommandError, Parser
from emu.footprint import UNKNOWN, Piece, pieces, totals
from emu.image import Image
from emu.loader import load_image


def parser() -> Parser:
    made = Parser(
        "footprint",
        "Print what an image costs in ROM and RAM (bytes; 3 per program word), by part, source file and symbol.",
        "emu footprint firmware.elf --symbols 20",
    )
    made.add_argument("image", metavar="IMAGE", help="ELF executable")
    made.add_argument("--symbols", metavar="N", type=int, default=15, help="how many symbols to list (default 15)")
    made.add_argument("--json", action="store_true", help="print one JSON object with every symbol")
    return made


def run(options: argparse.Namespace) -> int:
    """Exit status: 0 printed, 2 bad input."""
    image = load_image(options.image)
    facts = static(image)
    print(json.dumps(facts, indent=2) if options.json else static_text(facts, options.symbols))
    return EXIT_OK


def static(image: Image) -> dict[str, Any]:
    """Sizes of the image as plain data, in bytes."""
    if image.kind != "elf":
        raise CommandError(f"{image.path}: a HEX file has neither symbols nor RAM sections; give the ELF file")
    found = pieces(image)
    rom, ram = sum(piece.rom for piece in found), sum(piece.ram for piece in found)
    parts = totals(found, "group")

    def without(*names: str) -> dict[str, int]:
        return {
            "rom": rom - sum(parts.get(name, (0, 0))[0] for name in names),
            "ram": ram - sum(parts.get(name, (0, 0))[1] for name in names),
        }

    return {
        "path": image.path,
        "rom": rom,
        "ram": ram,
        "without_start_up": without("start-up", "vectors"),
        "without_start_up_and_printf": without("start-up", "vectors", "printf"),
        "parts": _pairs(parts),
        "kinds": _pairs(totals(found, "kind")),
        "modules": _pairs(totals(found, "module")),
        "symbols": [asdict(piece) for piece in _by_name(found)],
    }


def _pairs(table: dict[str, tuple[int, int]]) -> dict[str, dict[str, int]]:
    return {label: {"rom": rom, "ram": ram} for label, (rom, ram) in table.items()}


def _by_name(found: list[Piece]) -> list[Piece]:
    """Pieces of one symbol that come from several files (inlined code) joined under the file with the most of it."""
    joined: dict[tuple[str, str], list[Piece]] = {}
    for piece in found:
        joined.setdefault((piece.name, piece.kind), []).append(piece)
    whole = [
        Piece(name, parts[0].module, kind, sum(p.rom for p in parts), sum(p.ram for p in parts))
        for (name, kind), parts in joined.items()
    ]
    return sorted(whole, key=lambda piece: (-piece.rom - piece.ram, piece.name))


def static_text(facts: dict[str, Any], symbols: int) -> str:
    """The sizes as lines for people."""
    lines = [f"{facts['path']}: ROM {facts['rom']:,} bytes, RAM {facts['ram']:,} bytes"]
    for key, words in (
        ("without_start_up", "without vectors and start-up code"),
        ("without_start_up_and_printf", "without vectors, start-up code and printf"),
    ):
        lines.append(f"{words}: ROM {facts[key]['rom']:,}, RAM {facts[key]['ram']:,}")
    tables = [("part", "parts"), ("source file", "modules")]
    if list(facts["modules"]) == [UNKNOWN]:
        tables.pop()
        lines.append("(no debug information: build with -g for sizes by source file)")
    for title, key in tables:
        lines += ["", f"{title:48} {'ROM':>7} {'RAM':>7}"]
        lines += [f"{name[-48:]:48} {size['rom']:7,} {size['ram']:7,}" for name, size in facts[key].items()]
    if symbols > 0:
        lines += ["", f"{'symbol':48} {'ROM':>7} {'RAM':>7}"]
        lines += [f"{item['name'][-48:]:48} {item['rom']:7,} {item['ram']:7,}" for item in facts["symbols"][:symbols]]
    return "\n".join(lines)
