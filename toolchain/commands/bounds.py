"""Command `bounds`: worst-case execution time, stack, interrupt masking and interrupt response."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from toolchain.bounds.annotations.reader import AnnotationSet, read_annotation_section
from toolchain.bounds.interference import BoundsReport, report_of
from toolchain.bounds.program import Program
from toolchain.bounds.report import Bound
from toolchain.commands.parser import parser
from toolchain.elf.read import read_executable
from toolchain.errors import ToolError
from toolchain.files import read_bytes, read_text
from toolchain.stack.annotations import Annotations, add_symbols, read_annotations

EXIT_OVER_LIMIT = 1
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
function is executed on all its inputs at once.  Code without a bound is listed with the source line to annotate
(bounds.h).  Cycles are those of the function's own code; interrupts have rows of their own.

Names in annotations get their values by --let; for our kernel n threads, m events, b newer events in the same bucket,
s subscriptions of one event, q queued messages, i times idle (above 0 what idles has no bound), u bytes of a stack
never used, k bytes of the largest stack. Further names make bounds tighter: t subscriptions of all events
together, o of one thread, h holes on a path of the heap's tree (10 at most, 11 in more than 4 kB)."""


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    p = parser("bounds", DESCRIPTION, "python -m toolchain bounds firmware.elf --let n=4 --limit Sys_Yield=90")
    p.add_argument("image")
    p.add_argument("-a", "--annotations", metavar="FILE", help="annotation file of `stack`")
    p.add_argument("--let", action="append", default=[], metavar="NAME=N", help="value of a name in annotations")
    p.add_argument("--function", action="append", default=[], metavar="NAME",
                   help="analyse this function (default: the kernel's calls, or main)")  # fmt: skip
    p.add_argument("--without", action="append", default=[], metavar="NAME",
                   help="ignore paths on which this function is called")  # fmt: skip
    p.add_argument("--limit", action="append", default=[], metavar="NAME=CYCLES", help="fail when NAME can take longer")
    p.add_argument("--stack-limit", action="append", default=[], metavar="NAME=BYTES", help="fail when NAME needs more")
    p.add_argument("--json", action="store_true", help="machine-readable output")
    return p


def main(arguments: list[str]) -> int:
    """Print the report; return 0, or 1 if a --limit is exceeded or there is no bound to compare."""
    options = options_of().parse_args(arguments)
    file = options.annotations
    stack_annotations = read_annotations(read_text(file), file) if file else Annotations()
    image = read_executable(read_bytes(options.image), options.image)
    add_symbols(stack_annotations, image.symbols)
    annotations = read_annotation_section(image, dict(_pair("--let", text) for text in options.let))
    program = Program(image, stack_annotations, annotations, options.without)
    report = report_of(program, options.function or program.default_functions(KERNEL))
    print(json.dumps(_as_data(report), indent=1) if options.json else as_text(report, annotations))
    limits = [(_pair("--limit", text), "cycles") for text in options.limit]
    limits += [(_pair("--stack-limit", text), "bytes of stack") for text in options.stack_limit]
    return max([_check(report, *limit, what) for limit, what in limits], default=0)


def _pair(option: str, text: str) -> tuple[str, int]:
    name, equals, value = text.partition("=")
    if not equals or not value.isdigit():
        raise ToolError(f"{option} {text}: expected NAME=NUMBER")
    return name, int(value)


def _as_data(report: BoundsReport) -> dict[str, object]:
    return asdict(report, dict_factory=lambda fields: {_JSON_KEYS.get(name, name): value for name, value in fields})


def as_text(report: BoundsReport, annotations: AnnotationSet) -> str:
    """Return the report as tables."""
    rows = report.rows
    width = max((len(row.name) for row in rows), default=8)
    lines = [f"{'':9} {'':{width}}   cycles  stack  held back: level 1    4    5    6  deepest path"]
    lines += [_row(row, width) for row in rows]
    if report.responses:
        lines += ["", f"{'interrupt':{width}}  level  held back  response  by"]
        lines += [
            f"{one.name:{width}}  {one.level:5}  {_number(one.masked):>9}  {_number(one.cycles):>8}  {one.where}"
            for one in report.responses
        ]
    if report.stacks:
        lines += ["", "stack under nested interrupts, by priority:"]
        lines += [f"  {name:{width}} {_number(size):>6}" for name, size in report.stacks.items()]
    unknown = report.contradictions | report.unbounded_responses
    unknown |= {place: why for row in rows for place, why in row.unbounded.items()}
    if unknown:
        lines += ["", "not bounded; annotate (bounds.h):"]
        lines += [f"  {place}: {why}" for place, why in sorted(unknown.items())]
    if annotations.missing:
        lines += [f"names without a value (--let): {', '.join(sorted(annotations.missing))}"]
    return "\n".join(lines)


def _row(row: Bound, width: int) -> str:
    cycles = "for ever" if row.is_endless else _number(row.cycles)
    held = " ".join(f"{row.masked[k][0] if k in row.masked else '-':>4}" for k in (1, 4, 5, 6))
    path = " > ".join(row.path)
    more = " " if row.stack_is_known else "+"
    return f"{row.kind:9} {row.name:{width}} {cycles:>8} {row.bytes:6}{more}{'':16} {held}  {path}"


def _number(value: int | None) -> str:
    return "?" if value is None else f"{value:,}"


def _check(report: BoundsReport, name: str, limit: int, what: str) -> int:
    rows = [row for row in report.rows if row.name in (name, name.removeprefix("_"))]
    if not rows:
        raise ToolError(f"no analysed function is called {name}")
    value = rows[0].cycles if what == "cycles" else rows[0].bytes if rows[0].stack_is_known else None
    if value is not None and value <= limit:
        return 0
    print(f"{name}: {_number(value)} {what}, the limit is {limit}")
    return EXIT_OVER_LIMIT
