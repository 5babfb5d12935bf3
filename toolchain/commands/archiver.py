"""Command `ar`: create, list and extract static libraries."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from toolchain.commands.parser import parser
from toolchain.elf.archive import ArchiveMember, archive_bytes, read_members
from toolchain.errors import ToolError
from toolchain.files import read_bytes, write_outputs


def options_of() -> argparse.ArgumentParser:
    """Return the argument parser of the command."""
    p = parser(
        "ar",
        "Make, list and extract static libraries.  Operations: r replace or add, q append, d delete,\n"
        "t list, x extract, s alone: rewrite the index.  Letters c, s, u, v, D are accepted without effect:\n"
        "an index is always written, dates and owners never.",
        "python -m toolchain ar rcs libswarm.a wheel.o camera.o",
    )
    p.add_argument("operation", help="r, q, d, t, x or s, with modifiers")
    p.add_argument("archive")
    p.add_argument("members", nargs="*", metavar="FILE")
    return p


def main(arguments: list[str]) -> int:
    """Run one operation (first letter of the key, as in GNU ar); return 0."""
    words = [word for word in arguments if word != "-omf=elf" and not word.startswith("-mdfp=")]  # from MPLAB X
    if words and re.fullmatch("-[rqdtxcsuvD]+", words[0]):
        words[0] = words[0][1:]
    options = options_of().parse_args(words)
    letters = options.operation.lstrip("-")
    action = [letter for letter in letters if letter in "rqdtx"] or (["s"] if "s" in letters else [])
    if len(action) != 1 or set(letters) - set("rqdtxcsuvD"):
        raise ToolError(f"operation {options.operation!r}: expected one of r, q, d, t, x, s with c, s, u, v, D")
    path = Path(options.archive)
    exists = path.exists()
    members = read_members(read_bytes(path), str(path)) if exists else []
    if not exists and action[0] not in "rq":
        raise ToolError(f"{path}: no such archive")
    names = [Path(name).name for name in options.members]
    if action[0] == "t":
        print("\n".join(m.name for m in members))
    elif action[0] == "x":
        _extract(members, names, str(path))
    else:
        kept = [m for m in members if m.name not in names] if action[0] == "d" else members
        if action[0] == "r":
            kept = _replace(members, options.members)
        elif action[0] == "q":
            kept = members + [ArchiveMember(Path(name).name, read_bytes(name)) for name in options.members]
        write_outputs([(path, archive_bytes(kept))])
    return 0


def _replace(members: list[ArchiveMember], files: list[str]) -> list[ArchiveMember]:
    """Return the members with those of the same name replaced by `files`, new ones at the end."""
    fresh = {Path(name).name: ArchiveMember(Path(name).name, read_bytes(name)) for name in files}
    result = [fresh.pop(m.name, m) for m in members]
    return result + list(fresh.values())


def _extract(members: list[ArchiveMember], names: list[str], archive: str) -> None:
    wanted = [m for m in members if not names or m.name in names]
    missing = set(names) - {m.name for m in wanted}
    if missing:
        raise ToolError(f"{archive}: no member {', '.join(sorted(missing))}")
    unsafe = [m.name for m in wanted if Path(m.name).name != m.name or m.name in ("", ".", "..")]
    if unsafe:
        raise ToolError(f"{archive}: member name {unsafe[0]!r} is not a plain file name")
    write_outputs([(m.name, m.data) for m in wanted])
