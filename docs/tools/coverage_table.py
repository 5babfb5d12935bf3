"""Write the shares of Python lines that the tests run into docs/coverage.md: `coverage_table.py build/coverage.json`.

`make coverage` runs the tests and then this script. Each folder of `emu`, `toolchain` and `arena` is a package, and
`openswarm` is one.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path, PurePath
from typing import Any

from generated_part import GeneratedPart

PAGE = Path(__file__).parents[1] / "coverage.md"
WHOLE = "openswarm"
"""Distribution that is one package in the table."""


def package_of(file: str) -> str:
    """Return the package of a source file, for example `emu/debug`."""
    parts = PurePath(file).parts
    return parts[0] if parts[0] == WHOLE or len(parts) == 2 else "/".join(parts[:2])


def table(report: dict[str, Any]) -> str:
    """Return a row per package: statements, those that ran, and the share, from coverage.py's JSON report."""
    lines, ran = Counter[str](), Counter[str]()
    for file, facts in report["files"].items():
        name = package_of(file)
        lines[name] += facts["summary"]["num_statements"]
        ran[name] += facts["summary"]["covered_lines"]
    rows = [(f"`{name}`", lines[name], ran[name]) for name in sorted(lines) if lines[name]]
    rows.append(("all", lines.total(), ran.total()))
    text = ["| package | statements | run, % |", "|---|---:|---:|"]
    text += [f"| {name} | {count:,} | {100 * done / count:.1f} |" for name, count, done in rows]
    return "\n".join(text) + "\n"


def main() -> int:
    if len(sys.argv) != 2:
        print("usage: python docs/tools/coverage_table.py build/coverage.json", file=sys.stderr)
        return 2
    report = json.loads(Path(sys.argv[1]).read_text("utf-8"))
    part = GeneratedPart(PAGE, "<!-- table -->\n", lambda: table(report), "<!-- end of table -->")
    PAGE.write_text(part.current(), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
