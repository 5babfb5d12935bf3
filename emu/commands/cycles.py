"""`emu cycles`: print the exact cycles of kernel and application operations, check or update a baseline of them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

from emu.commands.baseline_options import BaselineCommand, add_baseline_arguments, conditions_of
from emu.commands.board_options import add_board_options, board_of, set_up
from emu.commands.disasm import code_address
from emu.host.command import CommandError, Parser, seconds
from emu.host.exit_status import FAULT
from emu.image.loader import load_image
from emu.image.model import Image
from emu.kernel_metrics.application_cycles import measure
from emu.kernel_metrics.baseline import Baseline, Metric, MetricRow
from emu.kernel_metrics.blame import CodeListing, grown_lines
from emu.kernel_metrics.cycle_results import ApplicationCycles
from emu.kernel_metrics.suite import latency
from emu.kernel_metrics.suite import options as kernel_options
from emu.kernel_metrics.target import MeasureError

DESCRIPTION: Final = """\
Run a firmware image with the OpenSwarm kernel and print the cycles of its operations: preemptive and voluntary thread
switches by pair of threads, sending to delivery and handlers by event, interrupts, masked interrupts, wake-ups.

--function and --interval add own functions and intervals between two places (names, addresses, FILE:LINE). A function's
cycles exclude interrupts, other threads and the scheduler. The kernel is found by its debug information; nothing is
instrumented, and the numbers are exact.

--check compares least, median and most cycles of the occurrences that no interrupt disturbed. A number that grew is
attributed to source lines by aligning the old and the new instructions.

--suite runs the scenarios of the applications `latency` or `options` instead, which measure the kernel itself.

Exit status: 0 done, 1 a number is worse or the firmware has a fault, 2 bad input."""
COLUMNS: Final = ("min", "median", "p99", "max", "count")
GATED: Final = ("min", "median", "max")


def parser() -> Parser:
    made = Parser(
        "cycles", DESCRIPTION, "emu cycles firmware.elf --seconds 2 --function parse --interval main.c:30..main.c:40"
    )
    made.add_argument("image", metavar="IMAGE", help="ELF executable with debug information")
    made.add_argument("--seconds", metavar="S", type=seconds, default=Fraction(1), help="simulated time (default 1)")
    made.add_argument("--function", metavar="NAME", action="append", default=[], help="measure a function's calls")
    made.add_argument(
        "--interval",
        metavar="A..B",
        action="append",
        default=[],
        help="measure from place A to place B; may be repeated",
    )
    made.add_argument("--suite", action="store_true", help="run the scenarios of `latency` or `options`")
    made.add_argument("--engine", metavar="NAME", default="auto", help="with --suite: auto, jit or plain")
    add_baseline_arguments(made)
    add_board_options(made)
    return made


def run(options: argparse.Namespace) -> int:
    """Run the command. Return the exit status as listed in DESCRIPTION."""
    image = load_image(options.image)
    return _suite(image, options) if options.suite else _application(image, options)


def _application(image: Image, options: argparse.Namespace) -> int:
    """Measure the operations of an application."""
    from emu.api import Machine

    if image.kind != "elf":
        raise CommandError(f"{image.path}: a HEX file has no debug information; give the ELF file")
    functions = [(name, code_address(image, name)) for name in options.function]
    intervals = [_interval(image, text) for text in options.interval]
    command = BaselineCommand("cycles", options, conditions_of(options, parser()))
    machine = Machine(image.chip, engine="plain", board=board_of(options))
    machine.load(image)
    set_up(machine, options)
    try:
        result = measure(machine, machine.cycles_in(options.seconds), functions, intervals)
    except MeasureError as error:
        raise CommandError(str(error)) from None
    for kind, names in (("function", options.function), ("interval", options.interval)):
        for name in names:
            if f"{kind} {name}" not in result.operations:
                raise CommandError(f"--{kind} {name}: did not occur in {float(options.seconds):g} s")
    facts = {
        "path": image.path, "seconds": result.seconds,
        "operations": {name: one.statistics() for name, one in result.operations.items()},
    }  # fmt: skip
    fault = result.stop.fault if result.stop is not None else None
    if fault is not None:
        facts["fault"] = fault.facts()
    status = _finish(command, image, _numbers(result, CodeListing(image)), facts, _text(result))
    if fault is not None:
        print(f"emu cycles: {fault.report()}", file=sys.stderr)
        return FAULT
    return status


def _interval(image: Image, text: str) -> tuple[str, int, int]:
    begin, separator, end = text.partition("..")
    if not begin or not separator or not end:
        raise CommandError(f"--interval {text}: expected two places, A..B")
    return text, _address_of(image, begin), _address_of(image, end)


def _address_of(image: Image, text: str) -> int:
    """Return the address of a name, an address or FILE:LINE. Raises CommandError."""
    file, colon, line = text.rpartition(":")
    if not colon or not line.isdecimal():
        return code_address(image, text)
    starts = [row.start for row in image.lines.rows if row.line == int(line) and Path(row.file).match(file)]
    if not starts:
        raise CommandError(f"--interval {text}: no code comes from line {line} of {file}")
    return min(starts)


def _numbers(result: ApplicationCycles, listing: CodeListing) -> dict[str, Metric]:
    """Return the numbers of a baseline: those of undisturbed occurrences, else the least of all."""
    numbers = {}
    for name, operation in result.operations.items():
        statistics = operation.statistics()
        if not operation.undisturbed:
            numbers[f"{name}, min"] = Metric(statistics["min"], "cycles", is_gated=False)
            continue
        places = {"min": operation.shortest, "median": operation.shortest, "max": operation.longest}
        for key in GATED:
            where = listing.by_instruction(places[key])
            numbers[f"{name}, {key}"] = Metric(statistics[f"undisturbed_{key}"], "cycles", where=where)
    return numbers


def _text(result: ApplicationCycles) -> str:
    width = max((len(name) for name in result.operations), default=0)
    lines = [f"{'cycles':{width}} {' '.join(f'{name:>9}' for name in COLUMNS)} {'undisturbed':>12}"]
    for name, operation in result.operations.items():
        statistics = operation.statistics()
        cells = " ".join(f"{statistics[column]:9,}" for column in COLUMNS)
        lines.append(f"{name:{width}} {cells} {statistics['undisturbed']:12,}")
    return "\n".join(lines)


def _suite(image: Image, options: argparse.Namespace) -> int:
    """Run the scenarios of one of the kernel's measuring applications."""
    known = [each for each in (latency, kernel_options) if image.symbols.find(each.APPLICATION)]
    if not known:
        wanted = f"no symbol {latency.APPLICATION!r} or {kernel_options.APPLICATION!r}"
        raise CommandError(f"{image.path} is not the application `latency` or `options`: it has {wanted}")
    command = BaselineCommand("cycles", options, {}, " --suite")
    try:
        windows = known[0].run_measures(image, options.engine)
    except (MeasureError, ValueError) as error:
        raise CommandError(str(error)) from None
    listing = CodeListing(image)
    numbers = {
        name: Metric(one.cycles, "cycles", where=listing.by_instruction(one.where)) for name, one in windows.items()
    }
    width = max(len(name) for name in numbers)
    text = "\n".join(f"{name:{width}} {number.value:8,} cycles" for name, number in numbers.items())
    return _finish(command, image, numbers, {name: number.value for name, number in numbers.items()}, text)


def _finish(
    command: BaselineCommand, image: Image, numbers: Mapping[str, Metric], facts: dict[str, Any], text: str
) -> int:
    listing = CodeListing(image)

    def blame(row: MetricRow, stored: Baseline) -> list[tuple[str, int]]:
        if row.name not in stored.rows:
            return []
        return grown_lines(stored.rows[row.name].where, stored.code, numbers[row.name].where, listing)

    code = listing.code({function for number in numbers.values() for function in number.where})
    return command.finish(numbers, facts, lambda: text, blame, code)
