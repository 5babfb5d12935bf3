"""Write the table of AVR instructions into docs/reference/avr.md, or check it (exit status 1 if it is out of date)."""

from __future__ import annotations

import sys
from pathlib import Path

from emu.avr.isa.rows import ROWS

PAGE = Path(__file__).parents[1] / "reference" / "avr.md"
BEGIN, END = "<!-- table -->\n", "<!-- end of table -->"


def table() -> str:
    """Return the instruction table as Markdown."""
    lines = ["| syntax | bits | meaning | flags | cycles |", "|---|---|---|---|---:|"]
    for row in ROWS:
        meaning = f"`{row.does}`".replace("|", "\\|") if row.does else ""
        lines.append(f"| `{row.syntax}` | `{row.bits}` | {meaning} | {' '.join(row.flags)} | {row.cycles} |")
    return "\n".join(lines) + "\n"


def page() -> str:
    """Return the page with the current table."""
    before, _, rest = PAGE.read_text("utf-8").partition(BEGIN)
    return before + BEGIN + table() + END + rest.partition(END)[2]


def main() -> int:
    if sys.argv[1:] == ["--write"]:
        PAGE.write_text(page(), "utf-8")
        return 0
    return 0 if PAGE.read_text("utf-8") == page() else 1


if __name__ == "__main__":
    sys.exit(main())
