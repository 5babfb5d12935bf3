"""Write the table of AVR instructions into docs/reference/avr.md, or check it (exit status 1 if it is out of date)."""

from __future__ import annotations

import sys
from pathlib import Path

from generated_part import GeneratedPart

from emu.avr.isa.rows import ROWS

PAGE = Path(__file__).parents[1] / "reference" / "avr.md"


def table() -> str:
    """Return the instruction table as Markdown."""
    lines = ["| syntax | bits | meaning | flags | cycles |", "|---|---|---|---|---:|"]
    for row in ROWS:
        meaning = f"`{row.does}`".replace("|", "\\|") if row.does else ""
        lines.append(f"| `{row.syntax}` | `{row.bits}` | {meaning} | {' '.join(row.flags)} | {row.cycles} |")
    return "\n".join(lines) + "\n"


PART = GeneratedPart(PAGE, "<!-- table -->\n", table, "<!-- end of table -->")

if __name__ == "__main__":
    sys.exit(PART.command())
