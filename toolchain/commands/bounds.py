"""Command `bounds`: worst-case execution time, stack, interrupt masking and interrupt response."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import Any

from toolchain.bounds.annotations.file import FileAnnotations, read_annotation_file
from toolchain.bounds.interference import SECOND_STACK, BoundsReport, report_of
from toolchain.bounds.program import Program
from toolchain.bounds.report import Bound
from toolchain.commands.parser import parser
from toolchain.elf.read import read_executable
from toolchain.errors import ToolError
from toolchain.files import read_bytes, read_text

EXIT_OVER_LIMIT = 1
CYCLES, STACK = "cycles", "bytes of stack"
"""Units of limits."""
_JSON_KEYS = {
    "unbounded": "open",
    "contradictions": "open",
    "second_stack": "other",
    "on_second_stack": "nested",
    "is_endless": "forever",
    "masked_for_ever": "held",
    "disi_after_return": "behind",
    "longest_instruction": "slowest",
    "clock_stopped_at": "asleep",
    "nesting_disabled_at": "unnested",
    "priority_changes": "levels",
}
"""Keys of --json that differ from the field names of `BoundsReport` and `Bound`; scripts depend on them."""
KERNEL = "_Sys_"
DESCRIPTION = """Bounds of a linked image: cycles, stack, longest masked time, and response of each interrupt.  Every
function is executed on all its inputs at once.  What has no bound is shown as ? and listed with its reason and the
source line to annotate (bounds.h).  Cycles are those of the function's own code; interrupts have rows of their own.
Bytes of stack include the return address; those of main and of threads include the deepest chain of interrupts, so
they are what a thread needs (Sys_Start_ProcessWith).

Names in annotations get their values by --let; for our kernel n threads, m events, b newer events in the same bucket,
s subscriptions of one event, q queued messages, i times idle (above 0 what idles has no bound), u bytes of a stack
never used, k bytes of the largest stack. Further names make bounds tighter: t subscriptions of all events
together, o of one thread, h holes on a path of the heap's tree (10 at most, 11 in more than 4 kB).

An annotation file serves images without bounds.h, one statement per line, # starts a comment:

    calls FUNCTION: TARGET, TARGET     what pointer calls inside FUNCTION reach, * = any with its address taken
    depth FUNCTION BYTES               FUNCTION with all it calls uses at most BYTES, and is not analysed
    recursion FUNCTION COUNT           at most COUNT activations at once
    thread FUNCTION                    FUNCTION is the entry of a thread

or absolute symbols __stack_depth_of_F, __stack_recursion_of_F, __stack_thread_F in the firmware."""


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    p = parser("bounds", DESCRIPTION, "python -m toolchain bounds firmware.elf --let n=4 --stack-limit blinker=128")
    p.add_argument("image")
    p.add_argument("-a", "--annotations", metavar="FILE", help="annotation file")
    p.add_argument("--let", action="append", default=[], metavar="NAME=N", help="value of a name in annotations")
    p.add_argument("--function", action="append", default=[], metavar="NAME",
                   help="analyse this function (default: the kernel's calls, or main)")  # fmt: skip
    p.add_argument("--thread", action="append", default=[], metavar="FUNCTION", help="as `thread` in the file")
    p.add_argument("--any-handle", action="store_true",
                   help="pointer calls without annotation reach any function whose address is taken")  # fmt: skip
    p.add_argument("--without", action="append", default=[], metavar="NAME",
                   help="ignore paths on which this function is called")  # fmt: skip
    p.add_argument("--limit", action="append", default=[], metavar="NAME=CYCLES", help="fail when NAME can take longer")
    p.add_argument("--stack-limit", action="append", default=[], metavar="NAME=BYTES", help="fail when NAME needs more")
    p.add_argument("--json", action="store_true", help="machine-readable output")
    return p


def main(arguments: list[str]) -> int:
    """Print the report; return 0, or 1 if a limit is exceeded or there is no bound to compare."""
    options = options_of().parse_args(arguments)
    name = options.annotations
    file = read_annotation_file(read_text(name), name) if name else FileAnnotations()
    file.threads += options.thread
    file.any_handle = options.any_handle
    image = read_executable(read_bytes(options.image), options.image)
    program = Program(image, dict(_pair("--let", text) for text in options.let), options.without, file)
    report = report_of(program, options.function or program.default_functions(KERNEL))
    limits = [(_pair("--limit", text), CYCLES) for text in options.limit]
    limits += [(_pair("--stack-limit", text), STACK) for text in options.stack_limit]
    exceeded = list(filter(None, [_exceeded(report, *limit, what) for limit, what in limits]))
    if options.json:
        print(json.dumps(_as_data(report) | {"exceeded": exceeded}, indent=1))
    else:
        print(as_text(report, program))
        for one in exceeded:
            print(f"{one['name']}: {_number(one['value'])} {one['unit']}, the limit is {one['limit']}")
            for place, why in sorted(one["reasons"].items()):
                print(f"  {place}: {why}")
    return EXIT_OVER_LIMIT if exceeded else 0


def _pair(option: str, text: str) -> tuple[str, int]:
    name, equals, value = text.partition("=")
    if not equals or not value.isdigit():
        raise ToolError(f"{option} {text}: expected NAME=NUMBER")
    return name, int(value)


def _as_data(report: BoundsReport) -> dict[str, object]:
    return asdict(report, dict_factory=lambda fields: {_JSON_KEYS.get(name, name): value for name, value in fields})


def as_text(report: BoundsReport, program: Program) -> str:
    """Return the report as tables."""
    rows = report.rows
    width = max((len(row.name) for row in rows), default=8)
    lines = [f"{'':9} {'':{width}}   cycles  stack     masked: level 1    4    5    6  deepest path"]
    lines += [_row(row, width) for row in rows]
    if SECOND_STACK in report.stacks:
        lines.append(f"{'stack':9} {SECOND_STACK:{width}} {'':8} {_number(report.stacks[SECOND_STACK]):>6}")
    if report.responses:
        lines += ["", f"{'interrupt':{width}}  level     masked  response  by"]
        lines += [
            f"{one.name:{width}}  {one.level:5}  {_number(one.masked):>9}  {_number(one.cycles):>8}  {one.where}"
            for one in report.responses
        ]
    unknown = report.unbounded_responses | report.unbounded_stacks
    unknown |= {place: why for row in rows for place, why in row.unbounded.items()}
    if unknown:
        lines += ["", "not bounded; annotate (bounds.h):"]
        lines += [f"  {place}: {why}" for place, why in sorted(unknown.items())]
    if program.annotations.missing:
        lines += [f"names without a value (--let): {', '.join(sorted(program.annotations.missing))}"]
    return "\n".join(lines)


def _row(row: Bound, width: int) -> str:
    cycles = "for ever" if row.is_endless else _number(row.cycles)
    held = " ".join(f"{_held(row, level):>4}" for level in (1, 4, 5, 6))
    path = " > ".join(row.path)
    return f"{row.kind:9} {row.name:{width}} {cycles:>8} {_number(row.stack_bytes):>6}{'':17} {held}  {path}"


def _held(row: Bound, level: int) -> str:
    if level not in row.masked:
        return "-"
    cycles, _ = row.masked[level]
    return "?" if cycles is None else str(cycles)


def _number(value: int | None) -> str:
    return "?" if value is None else f"{value:,}"


def _exceeded(report: BoundsReport, name: str, limit: int, what: str) -> dict[str, Any] | None:
    """Return the bound of `name` that exceeds its limit, or that is unknown, with reasons; None if the limit holds."""
    rows = [row for row in report.rows if row.name in (name, name.removeprefix("_"))]
    if not rows:
        raise ToolError(f"no analysed function is called {name}")
    row = rows[0]
    value, reasons = (row.cycles, row.unbounded) if what == CYCLES else (row.stack_bytes, report.unbounded_stacks)
    if value is not None and value <= limit:
        return None
    return {"name": name, "unit": what, "value": value, "limit": limit, "reasons": {} if value is not None else reasons}
