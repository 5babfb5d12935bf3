"""Symbols, locations and values of expressions while a file is being assembled.

The value of an expression is an `int`, a `SymbolValue` (symbol - symbol + offset under an optional operator), or a
`PendingOperation`. The operands of the latter become numbers when all labels have their final location.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from toolchain.elf import constants as c
from toolchain.elf.model import Bind
from toolchain.errors import SourceLocation


class LabelledSection:
    """Section of a label, without content; `sections.AsmSection` adds the content."""

    name: str
    flags: int
    is_code: bool


@dataclass(slots=True, eq=False)
class Frag:
    """A fragment of a section with fixed distances within it; it ends at a call that --relax may shorten."""

    section: LabelledSection
    start: int = 0  # address units from the section start; final after relaxation


@dataclass(slots=True, eq=False)
class Label:
    """A location: `offset` address units into `frag`."""

    frag: Frag
    offset: int


@dataclass(slots=True, eq=False)
class AsmSymbol:
    """A symbol.  `place` is None while it is undefined, else a `Label` or the value of an equate."""

    name: str
    place: Label | ExprValue | None = None
    bind: Bind | None = None
    type: int = c.STT_NOTYPE
    size: ExprValue | None = None
    visibility: int = c.STV_DEFAULT
    common: tuple[int, int] | None = None
    used: bool = False
    first_use: SourceLocation | None = field(default=None)


@dataclass(frozen=True, slots=True)
class SymbolValue:
    """op(add - sub + offset); `op` is "" for a plain address."""

    add: AsmSymbol | None = None
    sub: AsmSymbol | None = None
    offset: int = 0
    op: str = ""


@dataclass(frozen=True, slots=True)
class PendingOperation:
    """An operation on values that are not numbers yet.

    op  a binary operator; "u" and a prefix operator, or "f" and an operator such as tbloffset, with `right` None
    """

    op: str
    left: ExprValue
    right: ExprValue | None


ExprValue = int | SymbolValue | PendingOperation
