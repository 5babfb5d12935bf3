"""`emu coverage`: report the lines, branches and instructions that a run executes, for lcov and Cobertura."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable
from fnmatch import fnmatch
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

from emu.commands.board_options import add_board_options, board_of, set_up
from emu.commands.image_option import add_chip_option, image_of
from emu.host.command import CommandError, Parser, seconds
from emu.host.exit_status import DONE, FAULT
from emu.host.files import atomic_text_file, read_file
from emu.host.sources import SourceFinder
from emu.image.model import Image
from emu.instruments.coverage import Counts, CoverageReport, count_executions
from emu.instruments.coverage_pages import lines_run, outcomes_seen, percent, write_pages
from emu.instruments.disassembly import items
from emu.kernel_metrics.owners import APPLICATION, owner_of_module
from emu.machine.fault import FaultReport

KEYS: Final = ("lines", "branch outcomes")
DESCRIPTION: Final = """\
Run a firmware image and report the executed code, from exact counts in the unmodified image.

Reports: a table of the source files, HTML pages, lcov and Cobertura. The kernel and its drivers are in them only with
--kernel; --only selects files. Branches are those of the object code: both outcomes of every conditional branch and
skip. Comments LCOV_EXCL_LINE, _START and _STOP exclude lines. --counts adds the counts of earlier runs of the same
image, and stores the sum. UART1 goes to standard output. Functions that the linker removed are not in the report.

Exit status: 0 done, 1 firmware fault (the reports are written), 2 bad input."""


def parser() -> Parser:
    example = "emu coverage firmware.elf --seconds 1 --only src/ --html coverage"
    made = Parser("coverage", DESCRIPTION, example)
    made.add_argument("image", metavar="IMAGE", help="ELF executable with debug information")
    add_chip_option(made)
    made.add_argument("--seconds", metavar="S", type=seconds, default=Fraction(1), help="simulated time (default 1)")
    made.add_argument("--html", metavar="DIR", help="write HTML pages into a folder")
    made.add_argument("--lcov", metavar="FILE", help="write an lcov tracefile")
    made.add_argument("--cobertura", metavar="FILE", help="write Cobertura XML")
    made.add_argument("--counts", metavar="FILE", help="add the counts of this file, if it exists, and write the sum")
    made.add_argument("--root", metavar="DIR", default=".", help="first folder to search for sources (default .)")
    made.add_argument(
        "--only",
        metavar="PATTERN",
        action="append",
        default=[],
        help="only files such as src/ or '*/parser.c'",
    )
    made.add_argument("--kernel", action="store_true", help="also the OpenSwarm kernel and its drivers")
    made.add_argument("--json", action="store_true", help="print the totals as one JSON object")
    add_board_options(made)
    return made


def run(options: argparse.Namespace) -> int:
    """Run the command. Return the exit status as listed in DESCRIPTION."""
    from emu.api import Machine

    image = image_of(options)
    if not len(image.lines):
        raise CommandError(f"{image.path} has no line table; build it with -g")
    machine = Machine(image.chip, board=board_of(options))
    machine.load(image)
    set_up(machine, options)
    counts = _earlier(options, image)
    if not options.json:
        machine.uart[1].listen(lambda byte, _cycle: print(chr(byte & 0xFF), end="", flush=byte == 0x0A))
    stop_counting = count_executions(machine, counts)
    stop = machine.run(seconds=options.seconds)
    stop_counting()
    sources = SourceFinder(image.path, options.root)
    report = CoverageReport(machine.inspector, counts, sources.path)
    instructions = _select(report, image, counts, options)
    if options.html:
        write_pages(Path(options.html), report.files, sources.path)
    if options.lcov:
        with atomic_text_file(options.lcov) as stream:
            stream.writelines(f"{line}\n" for line in report.lcov(sources.path))
    if options.cobertura:
        with atomic_text_file(options.cobertura) as stream:
            stream.write(report.cobertura(sources.path))
    if options.counts:
        with atomic_text_file(options.counts) as stream:
            json.dump(counts.facts(image), stream)
    _print(report, instructions, options.json, stop.fault)
    if stop.fault is not None:
        print(f"emu coverage: {stop.fault.report()}", file=sys.stderr)
    return FAULT if stop.fault is not None else DONE


def _earlier(options: argparse.Namespace, image: Image) -> Counts:
    if not options.counts or not Path(options.counts).exists():
        return Counts()
    try:
        return Counts.of(json.loads(read_file(options.counts)), image)
    except (ValueError, RecursionError) as error:
        raise CommandError(f"{options.counts}: {error}") from None


def _select(report: CoverageReport, image: Image, counts: Counts, options: argparse.Namespace) -> tuple[int, int]:
    """Remove the files that the options exclude. Return the executed and all instructions of the other files.

    Raises CommandError if no file matches --only.
    """
    has_kernel = any(owner_of_module(name) != APPLICATION for name in report.files)
    own = sorted(name for name in report.files if owner_of_module(name) == APPLICATION)
    for name in list(report.files):
        is_foreign = has_kernel and own and not options.kernel and owner_of_module(name) != APPLICATION
        if (is_foreign and not options.only) or (options.only and not _matches(name, options.only)):
            del report.files[name]
    if options.only and not report.files:
        some = f"; its own files: {', '.join(own[:3])}" + ", ..." * (len(own) > 3) if own else ""
        raise CommandError(f"--only {options.only[0]}: no source file of {image.path} matches{some}")
    if not options.only and (options.kernel or not (has_kernel and own)):
        return report.instructions_run, report.instructions
    addresses: set[int] = set()
    for row in image.lines.rows:
        if row.file in report.files:
            addresses.update(item.address for item in items(image, row.start, row.end))
    return sum(counts.executed[address] > 0 for address in addresses), len(addresses)


def _matches(name: str, patterns: list[str]) -> bool:
    return any(fnmatch(name, pattern) or fnmatch(name, f"{pattern.rstrip('/')}/*") for pattern in patterns)


def _print(
    report: CoverageReport, instructions: tuple[int, int], as_json: bool, fault: FaultReport | None
) -> None:
    """Print one row per file and the totals; as JSON also the firmware's fault."""
    by_file = {name: (lines_run(one), outcomes_seen(one)) for name, one in sorted(report.files.items())}
    totals = {
        "lines": _summed(lines for lines, _ in by_file.values()),
        "branch outcomes": _summed(outcomes for _, outcomes in by_file.values()),
        "instructions": instructions,
    }
    if as_json:
        facts: dict[str, Any] = {name: {"run": part, "all": whole} for name, (part, whole) in totals.items()}
        facts["files"] = {
            name: {key: {"run": part, "all": whole} for key, (part, whole) in zip(KEYS, both, strict=True)}
            for name, both in by_file.items()
        }
        print(json.dumps(facts | ({"fault": fault.facts()} if fault is not None else {})))
        return
    width = max(map(len, (*by_file, "branch outcomes")))
    print(f"{'file':{width}} {'lines':>16} {'':>8} {'branch outcomes':>16}")
    for name, ((run, lines), (seen, outcomes)) in by_file.items():
        cells = f"{f'{run:,} of {lines:,}':>16} {percent(run, lines):>8} {f'{seen:,} of {outcomes:,}':>16}"
        print(f"{name:{width}} {cells} {percent(seen, outcomes):>8}")
    for name, (part, whole) in totals.items():
        print(f"{name:16} {part:7,} of {whole:7,}  {100 * part / whole if whole else 100:6.2f} %")


def _summed(pairs: Iterable[tuple[int, int]]) -> tuple[int, int]:
    found = list(pairs)
    return sum(part for part, _ in found), sum(whole for _, whole in found)
