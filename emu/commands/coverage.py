"""`emu coverage`: report the lines, branches and instructions that a run executes, for lcov and Cobertura."""

from __future__ import annotations

import argparse
import json
import sys
from fractions import Fraction
from pathlib import Path
from typing import Final

from emu.commands.board_options import add_board_options, board_of, set_up
from emu.commands.image_option import add_chip_option, image_of
from emu.host.command import CommandError, Parser, seconds
from emu.host.exit_status import DONE, FAULT
from emu.host.files import atomic_text_file
from emu.image.model import Image
from emu.instruments.coverage import Counts, CoverageReport, count_executions

DESCRIPTION: Final = """\
Run a firmware image and report the executed code, from exact counts in the unmodified image.

Reports: lcov (genhtml --branch-coverage converts it to HTML) and Cobertura. Branches are those of the object code: both
outcomes of every conditional branch and skip. Comments LCOV_EXCL_LINE, _START and _STOP exclude lines. --counts adds
the counts of earlier runs of the same image, and stores the sum. UART1 goes to standard output. Functions that the
linker removed are not in the report.

Exit status: 0 done, 1 firmware fault (the reports are written), 2 bad input."""


def parser() -> Parser:
    example = "emu coverage firmware.elf --seconds 1 --lcov out.info && genhtml --branch-coverage -o html out.info"
    made = Parser("coverage", DESCRIPTION, example)
    made.add_argument("image", metavar="IMAGE", help="ELF executable with debug information")
    add_chip_option(made)
    made.add_argument("--seconds", metavar="S", type=seconds, default=Fraction(1), help="simulated time (default 1)")
    made.add_argument("--lcov", metavar="FILE", help="write an lcov tracefile")
    made.add_argument("--cobertura", metavar="FILE", help="write Cobertura XML")
    made.add_argument("--counts", metavar="FILE", help="add the counts of this file, if it exists, and write the sum")
    made.add_argument("--root", metavar="DIR", default=".", help="base folder of relative file names (default .)")
    made.add_argument("--json", action="store_true", help="print the totals as one JSON object")
    add_board_options(made)
    return made


def run(options: argparse.Namespace) -> int:
    """Run the command. Return the exit status as listed in DESCRIPTION."""
    from emu.api import Machine

    image = image_of(options)
    if not len(image.lines):
        raise CommandError(f"{image.path} has no line table; build it with -g")
    machine = Machine(image.chip, engine="plain", board=board_of(options))
    machine.load(image)
    set_up(machine, options)
    counts = _earlier(options, image)
    if not options.json:
        machine.uart[1].listen(lambda byte, _cycle: print(chr(byte & 0xFF), end="", flush=byte == 0x0A))
    stop_counting = count_executions(machine, counts)
    stop = machine.run(seconds=options.seconds)
    stop_counting()
    root = Path(options.root).resolve()
    report = CoverageReport(machine.inspector, counts, root.joinpath)
    if options.lcov:
        with atomic_text_file(options.lcov) as stream:
            stream.writelines(f"{line}\n" for line in report.lcov(root.joinpath))
    if options.cobertura:
        with atomic_text_file(options.cobertura) as stream:
            stream.write(report.cobertura(root.joinpath))
    if options.counts:
        with atomic_text_file(options.counts) as stream:
            json.dump(counts.facts(image), stream)
    _print(report, options.json)
    if stop.fault is not None:
        print(f"emu coverage: {stop.fault.report()}", file=sys.stderr)
    return FAULT if stop.fault is not None else DONE


def _earlier(options: argparse.Namespace, image: Image) -> Counts:
    if not options.counts or not Path(options.counts).exists():
        return Counts()
    try:
        return Counts.of(json.loads(Path(options.counts).read_text(encoding="utf-8")), image)
    except ValueError as error:
        raise CommandError(f"{options.counts}: {error}") from None


def _print(report: CoverageReport, as_json: bool) -> None:
    lines = [count for one in report.files.values() for count in one.lines.values()]
    totals = {
        "lines": (sum(count > 0 for count in lines), len(lines)),
        "branch outcomes": (report.outcomes_seen, report.outcomes),
        "instructions": (report.instructions_run, report.instructions),
    }
    if as_json:
        print(json.dumps({name: {"run": part, "all": whole} for name, (part, whole) in totals.items()}))
        return
    for name, (part, whole) in totals.items():
        print(f"{name:16} {part:7,} of {whole:7,}  {100 * part / whole if whole else 100:6.2f} %")
