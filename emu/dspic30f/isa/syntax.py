"""Assembly syntax of rows: operand kinds, spellings of mnemonics, and aliases (isa.md §16)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

from .operands import Address, Bit, FileAddress, FileBit, Fixed, Kind, Literal, OffsetAddress, Register, Target
from .operands_dsp import Accumulator, Prefetch, PrefetchData, Product, WriteBack
from .row import Row
from .table import BY_ID, ROWS

KINDS: Mapping[str, Kind] = {
    "f": FileAddress(),
    "f, #bit4": FileBit(),
    "WREG": Fixed("WREG"),
    "Wn": Register("ds"),
    "Wb": Register("ws"),
    "Ws": Address("s", "p", "g"),
    "[Ws]": Address("s", "p", "g"),
    "Wd": Address("d", "q", "h"),
    "[Wd]": Address("d", "q", "h"),
    "Wns": Register("s"),
    "Wnd": Register("d"),
    "Wm": Register("vt"),
    "[Ws+Slit10]": OffsetAddress("s"),
    "[Wd+Slit10]": OffsetAddress("d"),
    "#lit1": Literal("k", 0, 1),
    "#lit4": Literal("k", 0, 15),
    "#lit5": Literal("k", 0, 31),
    "#lit8": Literal("k", -128, 255, byte=True),
    "#lit10": Literal("k", 0, 1023),
    "#lit14": Literal("k", 0, 16383),
    "#lit16": Literal("k", -32768, 65535),
    "#Slit4": Literal("r", -8, 7),
    "#Slit6": Literal("k", -16, 16),
    "#bit4": Bit(),
    "Expr": Target(),
    "Acc": Accumulator(),
    "Wm*Wn": Product(square=False),
    "Wm*Wm": Product(square=True),
    "{,[Wx],Wxd}": Prefetch("i", "x", 8),
    "{,[Wy],Wyd}": Prefetch("j", "y", 10),
    "[Wx]": Prefetch("i", "", 8),
    "[Wy]": Prefetch("j", "", 10),
    "Wxd": PrefetchData(),
    "{,AWB}": WriteBack(),
}
# Branch conditions and their synonyms, isa.md §7.2
# fmt: off
CONDITIONS = frozenset((
    "OV", "C", "Z", "N", "LE", "LT", "LEU", "NOV", "NC", "NZ", "NN", "GT", "GE", "GTU", "OA", "OB", "SA", "SB",
    "GEU", "LTU", "EQ", "NEQ",
))
# fmt: on


@lru_cache(None)
def kinds_of(syntax: str) -> tuple[Kind, ...]:
    """Return the operand kinds of the syntax of a row or alias, in order."""
    _, _, operands = syntax.partition(" ")
    names = [name.strip(" ,") for name in re.findall(r"\{,.*?\}|f, #bit4|[^{,]+", operands)]
    return tuple(Fixed(name) if name in CONDITIONS else KINDS[name] for name in names if name)


def spellings(syntax: str) -> Mapping[str, bool]:
    """Return the accepted mnemonics in lower case, each with whether it selects the byte form."""
    head, _, suffix = syntax.split(" ")[0].lower().partition("{")
    match suffix:
        case ".b}":
            return {head: False, f"{head}.w": False, f"{head}.b": True}
        case "w}":
            return {head: False, f"{head}w": False}
    return {head: False} if "." in head else {head: False, f"{head}.w": False}


@lru_cache(None)
def printed_mnemonic(row: Row, byte: int) -> str:
    """Return the mnemonic that binutils prints for a row with B = ``byte``."""
    head, _, suffix = row.syntax.split(" ")[0].lower().partition("{")
    if suffix == ".b}":
        return head + (".b" if byte or "B" not in row.fields else ".w")
    return head + suffix.rstrip("}")


@dataclass(frozen=True, slots=True)
class Form:
    """One spelling of a row: the row's own syntax, or an alias that sets the ``fixed`` fields."""

    syntax: str
    row: Row
    fixed: Mapping[str, int] = field(default_factory=dict)


def _alias(syntax: str, row: int, **fixed: int) -> Form:
    return Form(syntax, BY_ID[row], fixed)


STACK = 15
ALIASES = (
    _alias("PUSH Ws", 178, h=3, d=STACK),  # MOV Ws, [W15++]
    _alias("POP Wd", 178, g=4, s=STACK),  # MOV [--W15], Wd
    _alias("PUSH.D Wns", 180, q=3, d=STACK),
    _alias("POP.D Wnd", 179, p=4, s=STACK),
    _alias("BRA GEU, Expr", 137),
    _alias("BRA LTU, Expr", 145),
    _alias("BRA EQ, Expr", 138),
    _alias("BRA NEQ, Expr", 146),
    _alias("BSW Ws, Wb", 135),
    _alias("BTST Ws, #bit4", 124),
    _alias("BTST Ws, Wb", 126),
    _alias("BTSTS Ws, #bit4", 129),
    _alias("SUB{.B} Wn, #lit10", 13),
    _alias("SUBB{.B} Wn, #lit10", 18),
    _alias("ADD Ws, Acc", 47),
    _alias("LAC Ws, Acc", 48),
    _alias("SAC Acc, Wd", 49),
    _alias("SAC.R Acc, Wd", 50),
    _alias("DAW Wn", 185),
)


def _forms_by_name() -> Mapping[str, tuple[tuple[Form, bool], ...]]:
    """Return the forms by mnemonic.

    Forms with accumulators come first, because A and B are not file addresses there.
    """
    found: dict[str, list[tuple[Form, bool]]] = {}
    forms = [Form(row.syntax, row) for row in ROWS] + list(ALIASES)
    for form in sorted(forms, key=lambda form: "Acc" not in form.syntax):
        for name, byte in spellings(form.syntax).items():
            found.setdefault(name, []).append((form, byte))
    return {name: tuple(choices) for name, choices in found.items()}


FORMS = _forms_by_name()
