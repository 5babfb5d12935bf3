"""`emu cycles`: print the kernel operations' exact cycles, check them against a baseline, or update the baseline."""

from __future__ import annotations

import argparse
import json

from emu.host.command import CommandError, Parser
from emu.host.exit_status import DONE, FAULT
from emu.image.loader import load_image
from emu.kernel_metrics import baseline, latency
from emu.kernel_metrics import options as kernel_options
from emu.kernel_metrics.target import MeasureError

DESCRIPTION = """\
Run the scenarios of the `latency` application and print the cycles of the kernel's operations, or those of the
`options` application and print the cycles of the options' calls.

The numbers are exact and repeat exactly, so --check has no tolerance: it prints any increase over the baseline with
the source lines that grew, and exits with status 1."""


def parser() -> Parser:
    made = Parser("cycles", DESCRIPTION, "emu cycles firmware/build/latency/firmware.elf --check firmware/cycles.json")
    made.add_argument("image", metavar="IMAGE", help="ELF executable of the application `latency` or `options`")
    made.add_argument("--engine", metavar="NAME", default="auto", help="auto, jit or plain (default auto)")
    made.add_argument("--json", action="store_true", help="print one JSON object")
    add_baseline_arguments(made)
    return made


def add_baseline_arguments(parser: Parser) -> None:
    """Add --check FILE and --update FILE, for commands that print exact numbers."""
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--check", metavar="FILE", help="compare with a baseline; status 1 if anything grew")
    group.add_argument("--update", metavar="FILE", help="write the baseline")


def run(options: argparse.Namespace) -> int:
    """Run the command. Return 0 if printed or no number grew, 1 if a number grew, 2 for bad input."""
    image = load_image(options.image)
    known = [each for each in (latency, kernel_options) if image.symbols.find(each.APPLICATION)]
    if not known:
        wanted = f"no symbol {latency.APPLICATION!r} or {kernel_options.APPLICATION!r}"
        raise CommandError(f"{image.path} is not the application `latency` or `options`: it has {wanted}")
    try:
        windows = known[0].run_measures(image, options.engine)
    except (MeasureError, ValueError) as error:
        raise CommandError(str(error)) from None
    sources = baseline.Sources(image.path)
    numbers = {name: baseline.Number(w.cycles, sources.names(w.where)) for name, w in windows.items()}
    if options.update:
        baseline.save(options.update, numbers)
    if options.json:
        print(json.dumps({name: number.value for name, number in numbers.items()}, indent=2))
    elif not options.check:
        width = max(len(name) for name in numbers)
        print("\n".join(f"{name:{width}} {number.value:8,} cycles" for name, number in numbers.items()))
    return verdict(options, numbers, "cycles") if options.check else DONE


def verdict(options: argparse.Namespace, numbers: dict[str, baseline.Number], unit: str) -> int:
    """Print the comparison for --check. Return exit status 1 if a number grew, otherwise 0."""
    try:
        rows = baseline.compare(baseline.load(options.check), numbers)
    except ValueError as error:
        raise CommandError(str(error)) from None
    worse = any(row.is_worse for row in rows)
    if not options.json:
        print(baseline.table(rows, unit))
        if not worse and any(row.old is None or row.new != row.old for row in rows):
            print(f"nothing grew; keep the new numbers with --update {options.check}")
    return FAULT if worse else DONE
