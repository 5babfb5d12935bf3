"""Formatting of the server's responses for a terminal."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

from emu.host.sources import source_lines
from emu.prompt.appearance import COLUMNS
from emu.prompt.client import CommandRefusedError, Row

PER_ROW: Final = 4
"""Number of registers per line."""
ROW_BYTES: Final = 16
INTEGER: Final = re.compile(r"0x[0-9a-fA-F]+|-?\d+")
FORMATS: Final = "xdutca"
WORKING: Final = re.compile(r"[WR]\d+")
"""Names of working registers."""


def frame(row: Row) -> str:
    """Return a frame as text such as `add at program.c:12`."""
    if row.get("source"):
        return f"{row['name']} at {row['source']['name']}:{row['line']}"
    return f"{row['name']} at {row['instructionPointerReference']}"


def backtrace(frames: Sequence[Row], at: int) -> str:
    """Return one line per frame and mark the selected frame."""
    return "\n".join(f"{'*' if n == at else ' '} #{n} {frame(row)}" for n, row in enumerate(frames)) or "no frames"


def source(path: str, first: int, last: int, here: int = 0) -> str:
    """Return numbered lines of a file and mark line `here`. Raises CommandRefusedError if there are none."""
    try:
        lines = source_lines(path)
    except OSError as error:
        raise CommandRefusedError(f"{path}: {error.strerror}") from None
    first = max(first, 1)
    if first > len(lines):
        raise CommandRefusedError(f"{Path(path).name} has {len(lines)} lines")
    shown = enumerate(lines[first - 1 : last], first)
    return "\n".join(f"{'>' if n == here else ' '}{n:5} {text}".rstrip() for n, text in shown)


def number(text: str, form: str) -> str:
    """Return the number at the start of a value's text, in format `form`. Raises CommandRefusedError.

    The formats are hexadecimal (x), signed (d) and unsigned (u) decimal, binary (t), character (c) and address (a).
    """
    match = INTEGER.match(text)
    if match is None:
        raise CommandRefusedError(f"{text} is no whole number")
    value = int(match[0], 0)
    bits = next(bits for bits in (16, 32, 64, 4096) if -(1 << bits - 1) <= value < 1 << bits)
    unsigned = value & (1 << bits) - 1
    match form:
        case "x" | "a":
            return f"{unsigned:#x}"
        case "t":
            return f"{unsigned:#b}"
        case "c":
            return repr(chr(unsigned & 0xFF))
        case "u":
            return str(unsigned)
    return str(value)


def registers(rows: Sequence[Row]) -> str:
    """Return the working registers, four per line, then the other registers."""
    digits = {"uint8": 4, "uint16": 6}
    texts = [(one["name"], f"{int(one['value']):#0{digits.get(one.get('type', ''), 6)}x}" if one["value"].isdecimal()
              else one["value"]) for one in rows]  # fmt: skip
    working = [f"{name}={value}" for name, value in texts if WORKING.fullmatch(name)]
    lines = ["  ".join(f"{one:<11}" for one in working[at : at + PER_ROW]) for at in range(0, len(working), PER_ROW)]
    return "\n".join([*(line.rstrip() for line in lines),
                      *(f"{name} {value}" for name, value in texts if not WORKING.fullmatch(name))])  # fmt: skip


def sfrs(groups: Sequence[Row], requested: str) -> str:
    """Return the registers whose name or peripheral matches the pattern `requested`, with their fields.

    Without a pattern, list the peripherals. Raises CommandRefusedError if nothing matches.
    """
    if not requested:
        return "\n".join(f"{group['name']}: {' '.join(one['name'] for one in group['parts'])}" for group in groups)
    pattern = requested.upper()
    found = [
        f"{one['name']:<9} {one['address']}  {one['value']}  "
        + " ".join(f"{part['name']}={part['value']}" for part in one.get("parts", []))
        for group in groups
        for one in group["parts"]
        if fnmatchcase(one["name"].upper(), pattern) or fnmatchcase(group["name"].upper(), pattern)
    ]
    if not found:
        raise CommandRefusedError(f"no register and no peripheral is called {requested}")
    return "\n".join(line.rstrip() for line in found)


def memory(row: Row, size: int, form: str) -> str:
    """Return memory as units of `size` bytes, at most 16 bytes per line; with form "s" as a string."""
    data = base64.b64decode(row.get("data", ""))
    address = int(row["address"], 16)
    if form == "s":
        return f"{address:#06x}: {data.partition(bytes(1))[0].decode('latin-1')!r}"

    def unit(at: int) -> str:
        value = int.from_bytes(data[at : at + size], "little", signed=form == "d")
        return f"{value:#0{2 * size + 2}x}" if form in "xa" else number(str(value), form)

    units = [unit(at) for at in range(0, len(data) - size + 1, size)]
    width = max(map(len, units), default=0) + 1
    per_row = next(count for count in (16, 8, 4, 2, 1) if count * size <= ROW_BYTES and 7 + count * width <= COLUMNS)
    lines = [
        f"{address + size * at:#06x}: {' '.join(units[at : at + per_row])}" for at in range(0, len(units), per_row)
    ]
    if row["unreadableBytes"]:
        lines.append(f"{address + len(data):#06x}: no memory")
    return "\n".join(lines)


def disassembly(rows: Sequence[Row], here: int) -> str:
    """Return one instruction per line. A source line or function name precedes its first instruction."""
    lines = []
    for row in rows:
        if row.get("presentationHint") == "invalid":
            continue
        if row.get("symbol"):
            lines.append(f"{row['symbol']}:")
        if row.get("location"):
            lines.append(f"    {row['location']['name']}:{row['line']}")
        address = int(row["address"], 16)
        lines.append(f"{'>' if address == here else ' '} {row['address']}  {row['instructionBytes']}  "
                     f"{row['instruction']}".rstrip())  # fmt: skip
    return "\n".join(lines)


def variables(rows: Sequence[dict[str, Any]]) -> str:
    """Return one variable per line."""
    return "\n".join(f"{one['name']} = {one['value']}" for one in rows)
