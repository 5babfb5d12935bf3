"""Count the functions of kernel, drivers and run-time library that are proved equivalent to their IR.

    python -m bench.compiler.proofs [--part NAME] [--level -Os] [--jobs N] [--json]

Every C file of a part is compiled separately. The table counts its functions: proved, refuted, undecided, without
loops, with loops. Exit status 1 if one is refuted. Ctrl-C prints the table of the files that are done and exits.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from emu.host.exit_status import DONE, FAULT

ROOT = Path(__file__).resolve().parents[2]
SYSTEM = ROOT / "firmware" / "openswarm"
PARTS = {
    "kernel": ("kernel/*.c", "option/*.c"),
    "io": ("io/*.c", "io/*/*.c"),
    "port": ("port/dspic30f/*.c", "board/epuck/*.c", "board/epuck/*/*.c"),
}
LIBRARY = ROOT / "toolchain" / "runtime"
KINDS = ("proved", "refuted", "undecided")


def files() -> dict[str, list[Path]]:
    """Return the source files of each part."""
    found = {part: sorted(f for pattern in patterns for f in SYSTEM.glob(pattern)) for part, patterns in PARTS.items()}
    return found | {"library": sorted(LIBRARY.glob("*.c"))}


def options_of(part: str, level: str) -> list[str]:
    """Return the compiler options of each part."""
    if part == "library":
        return [level, "-w", "-std=c11", "-ffreestanding"]
    folders = [SYSTEM / name for name in ("include", "hal", "kernel", "io", "port/dspic30f", "board/epuck")]
    folders += [f for name in ("io", "board/epuck") for f in sorted((SYSTEM / name).iterdir()) if f.is_dir()]
    return [level, "-w", "-std=gnu99", *(f"-I{folder}" for folder in folders)]


def prove_file(level: str, work: tuple[str, Path]) -> tuple[str, str, list[dict[str, Any]]]:
    """Return part, file and verdicts of one file; no verdicts if it cannot be compiled separately."""
    from toolchain.errors import ToolError
    from toolchain.frontend.clang import ClangError
    from toolchain.proof.problem import compile_file
    from toolchain.proof.prove import verdicts

    part, file = work
    name = file.relative_to(ROOT).as_posix()
    try:
        return part, name, [asdict(v) for v in verdicts(compile_file([str(file), *options_of(part, level)]))]
    except (ToolError, ClangError) as error:
        print(f"{name}: {error}", file=sys.stderr)
        return part, name, []


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=[*PARTS, "library"], help="only this one")
    parser.add_argument("--level", default="-Os", help="of optimisation (default %(default)s): --level=-O2")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="files at once (default 1)")
    parser.add_argument("--json", action="store_true", help="every verdict, as JSON")
    options = parser.parse_args()
    work = [(part, file) for part, list_ in files().items() if options.part in (None, part) for file in list_]
    rows: list[dict[str, Any]] = []
    with ProcessPoolExecutor(options.jobs) as pool:
        results = pool.map(partial(prove_file, options.level), work)
        try:
            for number, (part, name, found) in enumerate(results, 1):
                rows += [{"part": part, "file": name, **verdict} for verdict in found]
                counts = Counter(verdict["kind"] for verdict in found)
                told = ", ".join(f"{counts[kind]} {kind}" for kind in KINDS)
                print(f"{number} of {len(work)} files: {name}: {told}", file=sys.stderr, flush=True)
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            print("interrupted: what follows is of the files until then", file=sys.stderr)
    print(json.dumps(rows, indent=1) if options.json else table(rows))
    return FAULT if any(row["kind"] == "refuted" for row in rows) else DONE


def table(rows: list[dict[str, Any]]) -> str:
    """Print the counts by part, and the reasons for missing verdicts."""
    lines = ["| part | loops | proved | refuted | undecided | share |", "|---|---|---|---|---|---|"]
    for part in [*dict.fromkeys(row["part"] for row in rows), "all"]:
        for loops in (False, True):
            of = Counter(row["kind"] for row in rows if row["loops"] == loops and part in ("all", row["part"]))
            total = sum(of.values())
            if total:
                counts = " | ".join(f"{of[kind]}" for kind in KINDS)
                lines.append(
                    f"| {part} | {'with' if loops else 'none'} | {counts} | {100 * of['proved'] / total:.0f} % |"
                )
    reasons = Counter(row["why"].split(":")[0] for row in rows if row["kind"] == "undecided" and not row["loops"])
    lines += ["", "undecided without loops:", *(f"{count:5} {why}" for why, count in reasons.most_common())]
    lines += [f"refuted: {row['file']} {row['function']}: {row['why']}" for row in rows if row["kind"] == "refuted"]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
