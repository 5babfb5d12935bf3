"""Write the tables of a port's files into docs/porting.md, or check them (exit status 1 if they are out of date).

    python docs/tools/port_files.py [--write]

The first table has the number of lines of each file of a port, without blank lines and comment lines. The second lists
the files elsewhere that name the newest port, its board or its compiler. A new port must change these files as well.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from generated_part import GeneratedPart

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "porting.md"
PORTS, BOARDS = ROOT / "firmware/openswarm/port", ROOT / "firmware/openswarm/board"
NEWEST = ("riscv", "qemu_virt")
"""Folders of the newest port and its board."""
NAMES = re.compile(r"\b(riscv|qemu_virt|riscv64-unknown-elf|qemu-system-riscv32)\b")
CODE = (".c", ".h", ".S", ".inc", ".ld")
READ = (*CODE, ".py", ".md", ".mk", ".yml", ".json", "")
"""Suffixes of files that may name a port."""
FOLDERS = (".ci", "docs", "firmware", "openswarm", "tests")
GENERATED = ("build", "baseline", "__pycache__")
COMMENT = re.compile(r"\s*(/\*|\*[ /]|//|#(?!\w)|;|@)")


def lines(path: Path) -> int:
    """Return the number of lines of code."""
    return sum(1 for line in path.read_text("utf-8").splitlines() if line.strip() and not COMMENT.match(line))


def naming_files() -> Iterator[str]:
    """Yield the paths of files outside the port and its board that name it."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            own = PORTS / NEWEST[0] in path.parents or BOARDS / NEWEST[1] in path.parents
            name = path.relative_to(ROOT)
            if own or path in (PAGE, Path(__file__)) or not path.is_file() or path.suffix not in READ:
                continue
            if not set(GENERATED) & set(name.parts) and NAMES.search(path.read_text("utf-8", "replace")):
                yield name.as_posix()


def tables() -> str:
    """Return both tables as Markdown."""
    ports = sorted(path for path in PORTS.iterdir() if path.is_dir())
    files = sorted({path.name for port in ports for path in port.iterdir() if path.suffix in CODE})
    head = ["file", *(port.name for port in ports)]
    out = [f"| {' | '.join(head)} |", "|---|" + "---:|" * len(ports)]
    for name in files:
        counts = (str(lines(port / name)) if (port / name).exists() else "" for port in ports)
        out.append(f"| `{name}` | {' | '.join(counts)} |")
    totals = (str(sum(lines(p) for p in port.iterdir() if p.suffix in CODE)) for port in ports)
    out += [f"| together | {' | '.join(totals)} |", ""]
    board = sum(lines(path) for path in (BOARDS / NEWEST[1]).iterdir() if path.suffix in CODE)
    out += [
        f"The board `{NEWEST[1]}` has {board} lines. Files elsewhere that name the port `{NEWEST[0]}` or its board:",
        "",
    ]
    by_folder: dict[str, list[str]] = {}
    for path in naming_files():
        by_folder.setdefault(path.rpartition("/")[0], []).append(path.rpartition("/")[2])
    out += ["| folder | files |", "|---|---|"]
    out += [f"| `{folder}` | {', '.join(f'`{name}`' for name in names)} |" for folder, names in by_folder.items()]
    return "\n".join(out) + "\n"


PART = GeneratedPart(PAGE, "<!-- port files -->\n", tables, "<!-- end of port files -->")

if __name__ == "__main__":
    sys.exit(PART.command())
