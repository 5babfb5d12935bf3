"""Command `prove`: proof that machine code implements the optimised IR."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from emu.host.errors import print_json_error
from emu.host.exit_status import DONE, FAULT
from toolchain.commands.parser import parser
from toolchain.errors import ToolError
from toolchain.files import write_outputs

if TYPE_CHECKING:
    from toolchain.proof.prove import Verdict

DESCRIPTION = """Proves for each function of a C file, for all inputs, that its machine code implements the optimised
LLVM IR: same volatile accesses and calls in the same order, same result, same memory, W8-W15 and the return address
preserved. The instruction table defines the meaning of the code; z3 searches for an input with a difference.

Per function: proved; refuted, with an input for which both differ (--keep writes an image that starts with it, for
`emu run` and `emu debug`; it ends at __returned); or undecided, with the reason. Loops with input-dependent iteration
counts are proved by induction. docs/design/proofs.md lists the assumptions.
Options of `cc` follow the file."""


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    p = parser("prove", DESCRIPTION, "python -m toolchain prove filter.c -Os -Iinclude")
    p.add_argument("file", help="C, C++ or LLVM IR")
    p.add_argument("--function", metavar="NAME", help="only this one")
    p.add_argument("--keep", metavar="FOLDER", help="images that start with the inputs found, FUNCTION.elf, for `emu`")
    p.add_argument("--json", action="store_true", help="machine-readable output")
    return p


def main(arguments: list[str]) -> int:
    """Print the verdicts; return 0, or 1 if a function is refuted.  Raises ToolError."""
    options, rest = options_of().parse_known_args(arguments)
    if find_spec("z3") is None:
        raise ToolError("prove needs z3: python -m pip install z3-solver")
    from toolchain.frontend.clang import ClangError
    from toolchain.proof.problem import compile_file
    from toolchain.proof.prove import verdicts

    try:
        made = compile_file([options.file, *rest])
    except ClangError:
        if options.json:  # clang has printed its messages on standard error
            print_json_error(f"{options.file}: errors in the source", FAULT)
        return FAULT
    if options.function is not None and options.function not in made.module.functions:
        raise ToolError(f"{options.file}: no function {options.function}")
    found = []
    for verdict in verdicts(made, options.function):
        found.append(verdict)
        if not options.json:
            print(_line(verdict), flush=True)
    counts = Counter(verdict.kind for verdict in found)
    if options.keep is not None:
        from toolchain.proof.counterexample import image

        kept = [(v.function, image(made, v.counterexample)) for v in found if v.counterexample is not None]
        write_outputs([(Path(options.keep) / f"{name}.elf", content) for name, content in kept])
    if options.json:
        print(json.dumps([_as_data(verdict) for verdict in found], indent=1))
    else:
        print(", ".join(f"{counts[kind]} {kind}" for kind in ("proved", "refuted", "undecided")), file=sys.stderr)
    return FAULT if counts["refuted"] else DONE


def _as_data(verdict: Verdict) -> dict[str, object]:
    """Return a verdict for --json, where the counterexample is called "witness"."""
    return {"witness" if name == "counterexample" else name: value for name, value in asdict(verdict).items()}


def _line(verdict: Verdict) -> str:
    text = f"{verdict.kind:10} {verdict.function}{' (loops)' if verdict.loops else ''}"
    if verdict.why:
        text += f": {verdict.why}"
    if verdict.counterexample is not None:
        text += f"\n           for {verdict.counterexample.text or 'every input'}"
    return text
