"""`emu footprint`: print ROM and RAM use of a firmware image, by part, source file and symbol."""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import asdict
from math import ceil
from typing import Any

from emu.commands.cycles import add_baseline_arguments, verdict
from emu.host.command import CommandError, Parser, count
from emu.host.exit_status import DONE
from emu.image.footprint import UNKNOWN, Piece, pieces, totals
from emu.image.loader import load_image
from emu.image.model import Image
from emu.kernel_metrics.baseline import Number, save, short

DESCRIPTION = """\
Print ROM and RAM use of an image (bytes; 3 per program word), by part, source file and symbol.

For the application `footprint`, also the memory of threads, events, subscriptions and messages: it is run with 60
loads, the heap is read from the running image, and the memory equation RAM = A + B n + C m + D s + sum (E + d) is
fitted. For the application `options`, the memory of each kernel option; --check then compares these numbers only."""


def parser() -> Parser:
    made = Parser(
        "footprint",
        DESCRIPTION,
        "emu footprint firmware.elf --symbols 20",
    )
    made.add_argument("image", metavar="IMAGE", help="ELF executable")
    made.add_argument("--symbols", metavar="N", type=count, default=15, help="how many symbols to list (default 15)")
    made.add_argument("--json", action="store_true", help="print one JSON object with every symbol")
    add_baseline_arguments(made)
    return made


def run(options: argparse.Namespace) -> int:
    """Run the command. Return 0 if printed or no number grew, 1 if a number grew, 2 for bad input."""
    image = load_image(options.image)
    facts = static(image)
    numbers = {name: Number(facts[key][size]) for name, key, size in _KEPT} | {
        "ROM": Number(facts["rom"], _places(facts, "rom")),
        "RAM": Number(facts["ram"], _places(facts, "ram")),
    }
    equation = _equation(image)
    if equation is not None:
        facts["equation"] = equation
        numbers |= {f"{name} of the memory equation": Number(ceil(equation[name])) for name in "ABCDE"}
        for owner, words in (("kernel", "of the kernel alone"), ("devices", "of kernel and devices")):
            numbers |= {f"{key} {words}": Number(equation["sizes"][owner][name]) for key, name in _SIZES}
    option_sizes = _options(image)
    if option_sizes is not None:
        facts["options"] = option_sizes
        numbers = {name: Number(size) for name, size in option_sizes.items()}
    if options.update:
        save(options.update, numbers)
    if options.json:
        print(json.dumps(facts, indent=2))
    elif not options.check:
        print(static_text(facts, options.symbols))
        if equation is not None:
            print("\n" + equation_text(equation))
        if option_sizes is not None:
            print("\n" + "\n".join(f"{name:48} {size:7,}" for name, size in option_sizes.items()))
    return verdict(options, numbers, "bytes") if options.check else DONE


def _places(facts: dict[str, Any], size: str) -> dict[str, int]:
    """Return bytes by source file. The file names do not depend on the location of the checkout."""
    return {short(name): sizes[size] for name, sizes in sorted(facts["modules"].items()) if sizes[size]}


_SIZES = (("ROM", "rom"), ("A", "A"))
_KEPT = (
    ("ROM without vectors, start-up code and printf", "without_start_up_and_printf", "rom"),
    ("RAM without start-up code and printf", "without_start_up_and_printf", "ram"),
)


def _equation(image: Image) -> dict[str, Any] | None:
    """Return the memory equation as plain data; None if the image is not the measuring application."""
    from emu.kernel_metrics.memory import APPLICATION, measure
    from emu.kernel_metrics.target import MeasureError

    if image.symbols.find(APPLICATION) is None:
        return None
    try:
        equation = measure(image)
    except MeasureError as error:
        raise CommandError(str(error)) from None
    return {
        **{name: float(value) for name, value in equation.coefficients.items()},
        "constant": equation.constant,
        "sizes": equation.sizes,
        "heap_capacity": equation.heap,
        "largest_residual": float(equation.residual),
        "cases": [asdict(case) for case in equation.cases],
    }


def _options(image: Image) -> dict[str, int] | None:
    """Return the bytes that each kernel option costs; None if the image is not the application `options`."""
    from emu.kernel_metrics.options import APPLICATION, sizes
    from emu.kernel_metrics.target import MeasureError

    if image.symbols.find(APPLICATION) is None:
        return None
    try:
        return sizes(image)
    except MeasureError as error:
        raise CommandError(str(error)) from None


def equation_text(equation: dict[str, Any]) -> str:
    """Return the memory equation as text, beside the equations of the paper and of the original."""
    from emu.kernel_metrics.memory import ORIGINAL, ORIGINAL_ROM, PAPER, PAPER_ROM

    alone, whole = equation["sizes"]["kernel"], equation["sizes"]["devices"]
    ours = {name: equation[name] for name in "ABCDE"}
    lines = [
        "RAM = A + B n + C m + D s + sum over pending messages of (E + d), in bytes;"
        f" exact for all {len(equation['cases'])} loads"
        if not equation["largest_residual"]
        else f"RAM = A + B n + ..., largest difference to a measurement {equation['largest_residual']:g} bytes",
        "n threads (128 bytes of stack), m events, s subscriptions, d bytes of payload, rounded up to words",
        "",
        f"{'':34} {'A':>7} {'B':>6} {'C':>6} {'D':>6} {'E':>6} {'ROM':>8}",
    ]
    for name, row, rom in (
        ("this kernel alone", ours | {"A": alone["A"]}, alone["rom"]),
        ("with motors, UARTs, LEDs, selector", ours, whole["rom"]),
        ("paper, Eq. (1)", PAPER, PAPER_ROM),
        ("original, as measured, alone", ORIGINAL, ORIGINAL_ROM["kernel"]),
        ("with motors, UART, remote control", ORIGINAL, ORIGINAL_ROM["devices"]),
    ):
        cells = " ".join(
            f"{row[key]:{7 if key == 'A' else 6}g}" if key in row else f"{'-':>{7 if key == 'A' else 6}}"
            for key in "ABCDE"
        )
        lines.append(f"{name:34} {cells} {rom:8,}")
    one_message = ours["C"] + ours["E"]
    lines += [
        "",
        "with one pending message per event and s = 0:"
        f" {alone['A']} (with devices {whole['A']}) + {ours['B']:g} n + {one_message:g} m + sum d",
        "ROM: code, constants, library code and slots for function pointers; no vectors, no start-up code",
        "parts of A",
        *(f"  {size:6,} {name}" for name, size in equation["constant"].items()),
        f"not in A: heap of {equation['heap_capacity']:,} bytes, from which all other memory is allocated",
    ]
    return "\n".join(lines)


def static(image: Image) -> dict[str, Any]:
    """Return the sizes of the image as plain data, in bytes."""
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
    """Join the pieces of each symbol, under the file that contributes most, and return them."""
    joined: dict[tuple[str, str], list[Piece]] = {}
    for piece in found:
        joined.setdefault((piece.name, piece.kind), []).append(piece)
    whole = [
        Piece(name, parts[0].module, kind, sum(p.rom for p in parts), sum(p.ram for p in parts))
        for (name, kind), parts in joined.items()
    ]
    return sorted(whole, key=lambda piece: (-piece.rom - piece.ram, piece.name))


def _near(path: str) -> str:
    """Return a path relative to the current folder, if it lies below it."""
    near = os.path.relpath(path)
    return path if near.startswith("..") or not path.startswith("/") else near


def static_text(facts: dict[str, Any], symbols: int) -> str:
    """Return the sizes as text."""
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
        lines += [f"{_near(name)[-48:]:48} {size['rom']:7,} {size['ram']:7,}" for name, size in facts[key].items()]
    if symbols > 0:
        lines += ["", f"{'symbol':48} {'ROM':>7} {'RAM':>7}"]
        lines += [f"{item['name'][-48:]:48} {item['rom']:7,} {item['ram']:7,}" for item in facts["symbols"][:symbols]]
    return "\n".join(lines)
