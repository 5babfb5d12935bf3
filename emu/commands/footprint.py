"""`emu footprint`: print ROM and RAM use of a firmware image, by part, source file and symbol."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping
from dataclasses import asdict
from fractions import Fraction
from functools import partial
from math import ceil
from pathlib import Path
from typing import Any

from emu.commands.baseline_options import BaselineCommand, add_baseline_arguments, conditions_of
from emu.commands.board_options import add_board_options, board_of, set_up
from emu.debug.dwarf.units import debug_of
from emu.host.command import CommandError, Parser, count, seconds
from emu.host.exit_status import FAULT
from emu.host.files import atomic_text_file
from emu.image.footprint import UNKNOWN, Piece, pieces, totals
from emu.image.loader import load_image
from emu.image.model import BYTES_PER_WORD, Image
from emu.kernel_metrics.application_memory import engine_for, measure
from emu.kernel_metrics.baseline import Baseline, Metric, MetricRow
from emu.kernel_metrics.blame import LINES_SHOWN, short
from emu.kernel_metrics.footprint_rows import grown_pieces, line_of, run_numbers, static_numbers
from emu.kernel_metrics.kernel_structures import KernelStructures
from emu.kernel_metrics.memory_picture import html, ram_parts, rom_parts, svg
from emu.kernel_metrics.memory_results import ApplicationMemory
from emu.kernel_metrics.memory_text import memory_text
from emu.kernel_metrics.owners import sizes_by_owner
from emu.kernel_metrics.suite import memory
from emu.kernel_metrics.suite import options as kernel_options
from emu.kernel_metrics.target import MeasureError

DESCRIPTION = """\
Print ROM and RAM use of an image (bytes; 3 per program word), by part, owner, source file and symbol.

An image with the OpenSwarm kernel is also run: threads with the high-water marks of their stacks, events with their
subscriptions and queued messages, drivers, free memory, and the memory equation with the application's numbers. The
kernel is found by its debug information; nothing is instrumented. --static omits the run.

--check compares all numbers with a baseline; a row of the file may have a limit: "limit": "at least 20 %".

For the application `footprint`, the memory equation is fitted to 60 loads. For the application `options`, --check
compares the memory of each kernel option only.

Exit status: 0 done, 1 a number is worse or the firmware has a fault, 2 bad input."""


def parser() -> Parser:
    made = Parser("footprint", DESCRIPTION, "emu footprint firmware.elf --seconds 2 --picture memory.html")
    made.add_argument("image", metavar="IMAGE", help="ELF executable")
    made.add_argument("--symbols", metavar="N", type=count, default=15, help="how many symbols to list (default 15)")
    made.add_argument("--seconds", metavar="S", type=seconds, default=Fraction(1), help="simulated time (default 1)")
    made.add_argument("--static", action="store_true", help="only the sizes of the image")
    made.add_argument("--picture", metavar="FILE", help="draw the memory: .svg, or .html with the tables")
    add_baseline_arguments(made)
    add_board_options(made)
    return made


def run(options: argparse.Namespace) -> int:
    """Run the command. Return the exit status as listed in DESCRIPTION."""
    image = load_image(options.image)
    facts = static(image)
    has_kernel = not options.static and _has_kernel(image)
    flags = "" if has_kernel or _is_measuring(image) else " --static"
    conditions = conditions_of(options, parser()) if has_kernel else {}
    command = BaselineCommand("footprint", options, conditions, flags)
    found = pieces(image)
    numbers = static_numbers(image, found)
    text = [partial(static_text, facts, options.symbols)]
    equation = _equation(image)
    if equation is not None:
        facts["equation"] = equation
        text.append(partial(equation_text, equation))
        numbers |= {f"{name} of the memory equation": Metric(ceil(equation[name])) for name in "ABCDE"}
        for owner, words in (("kernel", "of the kernel alone"), ("devices", "of kernel and devices")):
            numbers |= {f"{key} {words}": Metric(equation["sizes"][owner][name]) for key, name in _SIZES}
    option_sizes = _options(image)
    if option_sizes is not None:
        facts["options"] = option_sizes
        text.append(partial(_options_text, option_sizes))
        numbers = {name: Metric(size) for name, size in option_sizes.items()}
    use = _run(image, options) if has_kernel else None
    fault = use.stop.fault if use is not None and use.stop is not None else None
    if use is not None:
        facts["run"] = use.facts() | ({"fault": fault.facts()} if fault is not None else {})
        text.append(partial(memory_text, use))
        numbers |= run_numbers(use)
    if options.picture:
        _draw(options.picture, image, facts, use, "\n\n".join(part() for part in text))
    status = command.finish(
        numbers, facts, lambda: "\n\n".join(part() for part in text), partial(_blame, image, numbers, use), {}
    )
    if fault is not None:
        print(f"emu footprint: {fault.report()}", file=sys.stderr)
        return FAULT
    return status


def _is_measuring(image: Image) -> bool:
    """Whether the image is one of the kernel's measuring applications, which have their own scenarios."""
    return any(image.symbols.find(name) is not None for name in (memory.APPLICATION, kernel_options.APPLICATION))


def _has_kernel(image: Image) -> bool:
    """Whether a run can attribute the image's allocations: it has the kernel and its debug information."""
    try:
        KernelStructures(image).code("os_thread_start")
    except MeasureError:
        return False
    return not _is_measuring(image)


def _run(image: Image, options: argparse.Namespace) -> ApplicationMemory:
    """Run the image on the board of the options, and return its memory use. Raises CommandError."""
    from emu.api import Machine

    machine = Machine(image.chip, engine=engine_for(image), board=board_of(options))
    machine.load(image)
    set_up(machine, options)
    try:
        return measure(machine, machine.cycles_in(options.seconds))
    except MeasureError as error:
        raise CommandError(str(error)) from None


def _blame(
    image: Image, numbers: Mapping[str, Metric], use: ApplicationMemory | None, row: MetricRow, stored: Baseline
) -> list[tuple[str, int]]:
    """Return the symbols that grew with the lines that declare them, or the line that uses a thread or an event."""
    old = {file: dict(parts) for file, parts in stored.rows[row.name].where.items()} if row.name in stored.rows else {}
    new = {file: dict(parts) for file, parts in numbers[row.name].where.items()}
    if not old:
        line = line_of(row.name, use) if use is not None else ""
        return [(line, row.difference or row.new or 0)] if line else []
    return [(_declared(image, file, name), size) for file, name, size in grown_pieces(old, new)[:LINES_SHOWN]]


def _declared(image: Image, file: str, name: str) -> str:
    """Return where a symbol is declared: `src/main.c:12: table`."""
    debug = debug_of(image)
    plain = name.removeprefix("_")
    lines = [one.line for one in debug.functions if one.name == plain and short(one.file) == file]
    lines += [one.line for one in debug.globals.get(plain, []) if short(one.file) == file]
    return f"{file}:{lines[0]}: {plain}" if lines and lines[0] else f"{file}: {plain}"


def _draw(path: str, image: Image, facts: dict[str, Any], use: ApplicationMemory | None, text: str) -> None:
    """Write the picture of --picture. Raises CommandError for another suffix or an image without kernel."""
    if use is None:
        raise CommandError("--picture needs an image with the OpenSwarm kernel, and no --static")
    if not path.endswith((".svg", ".html")):
        raise CommandError(f"--picture {path}: expected a name that ends in .svg or .html")
    flash = BYTES_PER_WORD * image.chip.program["flash"].size // 2
    owners = {owner: sizes.rom for owner, sizes in sizes_by_owner(image).items()}
    ram = image.chip.data["ram"]
    picture = svg([
        (f"flash: {facts['rom']:,} of {flash:,} bytes", rom_parts(owners, facts["rom"], flash)),
        (f"RAM: {ram.end - ram.start:,} bytes", ram_parts(use, ram.end - ram.start)),
    ])  # fmt: skip
    with atomic_text_file(path) as stream:
        stream.write(picture if path.endswith(".svg") else html(Path(image.path).name, picture, text))


def _options_text(sizes: dict[str, int]) -> str:
    return "\n".join(f"{name:48} {size:7,}" for name, size in sizes.items())


_SIZES = (("ROM", "rom"), ("A", "A"))


def _equation(image: Image) -> dict[str, Any] | None:
    """Return the memory equation as plain data; None if the image is not the measuring application."""
    if image.symbols.find(memory.APPLICATION) is None:
        return None
    try:
        equation = memory.measure(image)
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
    if image.symbols.find(kernel_options.APPLICATION) is None:
        return None
    try:
        return kernel_options.sizes(image)
    except MeasureError as error:
        raise CommandError(str(error)) from None


def equation_text(equation: dict[str, Any]) -> str:
    """Return the memory equation as text, beside the equations of the paper and of the original."""
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
        ("paper, Eq. (1)", memory.PAPER, memory.PAPER_ROM),
        ("original, as measured, alone", memory.ORIGINAL, memory.ORIGINAL_ROM["kernel"]),
        ("with motors, UART, remote control", memory.ORIGINAL, memory.ORIGINAL_ROM["devices"]),
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


def _relative(path: str) -> str:
    """Return a path relative to the current folder, if it lies below it."""
    near = os.path.relpath(path)
    return path if near.startswith("..") or not path.startswith("/") else near


def _fitted(name: str) -> str:
    """Return a name that fits the column: a long one keeps its beginning and its end."""
    return name if len(name) <= 48 else f"{name[:22]}...{name[-23:]}"


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
        lines += [f"{_fitted(_relative(name)):48} {size['rom']:7,} {size['ram']:7,}"
                  for name, size in facts[key].items()]  # fmt: skip
    if symbols > 0:
        lines += ["", f"{'symbol':48} {'ROM':>7} {'RAM':>7}"]
        shown = facts["symbols"][:symbols]
        lines += [f"{_fitted(item['name']):48} {item['rom']:7,} {item['ram']:7,}" for item in shown]
    return "\n".join(lines)
