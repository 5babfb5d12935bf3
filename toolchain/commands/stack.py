"""Command `stack`: worst-case stack use."""

from __future__ import annotations

import argparse
import json

from emu.host.exit_status import DONE, FAULT
from toolchain.commands.parser import parser
from toolchain.elf.read import read_executable
from toolchain.errors import ToolError
from toolchain.files import read_bytes, read_text
from toolchain.stack.analyse import Analysis, Entry, StackReport
from toolchain.stack.annotations import Annotations, add_symbols, read_annotations

DESCRIPTION = """Worst-case stack use, in bytes, per function and per entry (reset, interrupt, thread, by pointer),
found by following every instruction path of the image.  Recursion, calls through pointers and unknown changes of
W15 are listed; an annotation file bounds them:

    calls FUNCTION: TARGET, TARGET     what pointer calls inside FUNCTION reach, * = any with its address taken
    depth FUNCTION BYTES               FUNCTION with all it calls uses at most BYTES
    recursion FUNCTION COUNT           at most COUNT activations at once
    thread FUNCTION                    FUNCTION is the entry of a thread

or absolute symbols __stack_depth_of_F, __stack_recursion_of_F, __stack_thread_F in the firmware.
A + after a number marks a lower bound: part of that path is unknown.  For a handler that switches to a stack of its
own, the bytes on the interrupted stack are shown too."""


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    p = parser("stack", DESCRIPTION, "python -m toolchain stack firmware.elf --thread blinker --limit blinker=128")
    p.add_argument("image")
    p.add_argument("-a", "--annotations", metavar="FILE")
    p.add_argument("--thread", action="append", default=[], metavar="FUNCTION", help="as `thread` in the file")
    p.add_argument("--limit", action="append", default=[], metavar="FUNCTION=N", help="fail when FUNCTION needs more")
    p.add_argument("--any-handle", action="store_true", help="pointer calls reach any function whose address is taken")
    p.add_argument("--functions", action="store_true", help="list every function, not only entries")
    p.add_argument("--json", action="store_true", help="machine-readable output")
    return p


def main(arguments: list[str]) -> int:
    """Print the report; return 0, or 1 if a --limit is exceeded or cannot be proved."""
    options = options_of().parse_args(arguments)
    file = options.annotations
    annotations = read_annotations(read_text(file), file) if file else Annotations()
    image = read_executable(read_bytes(options.image), options.image)
    add_symbols(annotations, image.symbols)
    annotations.threads += options.thread
    annotations.any_handle = options.any_handle
    report = Analysis(image, annotations).report()
    print(json.dumps(_as_data(report), indent=1) if options.json else _as_text(report, options.functions))
    return _check(report, options.limit)


def _as_data(report: StackReport) -> dict[str, list[dict[str, object]]]:
    return {
        "functions": [
            {
                "name": u.name,
                "address": u.entry,
                "frame": u.frame,
                "total": u.total,
                "path": u.path,
                "unknown": u.unknown,
            }
            for u in report.functions
        ],
        "entries": [
            {
                "kind": e.kind,
                "name": e.usage.name,
                "total": e.total,
                "before_switch": e.before_switch,
                "path": e.usage.path,
                "unknown": e.usage.unknown,
            }
            for e in report.entries
        ],
    }


def _as_text(report: StackReport, functions: bool) -> str:
    lines = [f"{'entry':10} {'bytes':>6}  deepest path"]
    for entry in report.entries:
        left = entry.before_switch
        note = f"  [{left} on the interrupted stack, the rest on its own]" if left is not None else ""
        mark = "+" if entry.usage.unknown else " "
        lines.append(f"{entry.kind:10} {entry.total:6}{mark} {' > '.join(entry.usage.path)}{note}")
    interrupts = [e for e in report.entries if e.kind == "interrupt"]
    lines.append(f"all interrupts nested once: {sum(map(_total, interrupts))} bytes")
    if functions:
        lines += ["", f"{'own':>6} {'total':>6}  function"]
        for usage in sorted(report.functions, key=lambda u: (-u.total, u.name)):
            lines.append(f"{usage.frame:6} {usage.total:6}{'+' if usage.unknown else ' '} {usage.name}")
    unknown = list(dict.fromkeys(reason for usage in report.functions for reason in usage.unknown))
    if unknown:
        lines += ["", "unknown (bound it with an annotation):", *(f"  {reason}" for reason in unknown)]
    return "\n".join(lines)


def _total(entry: Entry) -> int:
    return entry.total


def _check(report: StackReport, limits: list[str]) -> int:
    """Compare totals with the --limit options; return the exit status. An entry has precedence over a function."""
    status = DONE
    for limit in limits:
        name, equals, value = limit.partition("=")
        if not equals or not value.isdigit():
            raise ToolError(f"--limit {limit}: expected FUNCTION=BYTES")
        spellings = (name, "_" + name)
        found = [(e.total, e.usage) for e in report.entries if e.usage.name in spellings]
        found += [(u.total, u) for u in report.functions if u.name in spellings]
        if not found:
            raise ToolError(f"--limit {limit}: no function is called {name}")
        total, usage = found[0]
        if total > int(value) or usage.unknown:
            more = " or more" if usage.unknown else ""
            print(f"{name}: {total} bytes{more}, the limit is {value}: {' > '.join(usage.path)}")
            status = FAULT
    return status
