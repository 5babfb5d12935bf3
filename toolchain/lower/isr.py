"""Interrupt functions, addresses and other roles given by __attribute__((annotate("...")))."""

from __future__ import annotations

import re

from ..ir.model import ConstAgg, ConstBytes, ConstZero, GlobalRef, Module, UnsupportedError, Value

PREFIX = "os_isr:"
WORDS = {"interrupt", "auto_psv", "no_auto_psv", "shadow"}


def annotations_of(module: Module) -> dict[str, set[str]]:
    """Name of a function or variable -> its annotation strings."""
    table = module.globals.get("llvm.global.annotations")
    out: dict[str, set[str]] = {}
    if table is None or not isinstance(table.init, ConstAgg):
        return out
    for row in table.init.elems:
        if isinstance(row, ConstAgg) and isinstance(row.elems[0], GlobalRef):
            out.setdefault(row.elems[0].name, set()).add(_text(module, row.elems[1]))
    return out


def _text(module: Module, v: Value) -> str:
    if not isinstance(v, GlobalRef):
        return ""
    init = module.globals[v.name].init
    if isinstance(init, ConstZero):
        return ""
    return init.data.rstrip(b"\0").decode() if isinstance(init, ConstBytes) else ""


def interrupt_kind(name: str, notes: set[str]) -> str:
    """ "" for ordinary functions, else "no_auto_psv" or "auto_psv", with ",shadow" appended (abi-elf.md §2.5)."""
    words = {w for n in notes for w in n.removeprefix(PREFIX).split(",")} & WORDS
    if not any(n.startswith(PREFIX) for n in notes) and "interrupt" not in words:
        return ""
    if {"auto_psv", "no_auto_psv"} <= words:
        raise UnsupportedError("both auto_psv and no_auto_psv", name)
    kind = "no_auto_psv" if "no_auto_psv" in words else "auto_psv"
    return kind + (",shadow" if "shadow" in words else "")


def wants_probe(notes: set[str], default: bool) -> bool:
    """Whether a function's frame is probed against SPLIM: -fstack-check, overruled by "os_probe" or "os_no_probe"."""
    if "os_no_probe" in notes:
        return False
    return default or "os_probe" in notes


def section_modifiers(name: str, notes: set[str]) -> str:
    """`,address(0x1000)`, `,noload`, `,reverse(64)` for a `.section` line (abi-elf.md §4.3)."""
    out = ",noload" if "noload" in notes else ""
    for note in sorted(notes):
        found = re.fullmatch(r"(address|reverse)\((.*)\)", note)
        if found is None:
            continue
        try:
            number = int(found[2].strip("() ").rstrip("uUlL"), 0)
        except ValueError:
            raise UnsupportedError(f"attribute {note}: the argument must be a number", name) from None
        out += f",{found[1]}(0x{number:X})"
    return out
