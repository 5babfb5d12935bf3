"""Symbols while a file is being assembled, and the pieces of sections that labels point into."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from toolchain.elf import constants as c
from toolchain.elf.model import Bind

if TYPE_CHECKING:
    from toolchain.asm.expr import Known
    from toolchain.asm.sections import AsmSection
    from toolchain.errors import Place


@dataclass(slots=True, eq=False)
class Frag:
    """A run of content whose inner distances never change; a call that may be relaxed ends it."""

    section: AsmSection
    start: int = 0  # address units from the section start; final once relaxation has ended


@dataclass(slots=True, eq=False)
class Label:
    """A location: `offset` address units into `frag`."""

    frag: Frag
    offset: int


@dataclass(slots=True, eq=False)
class AsmSymbol:
    """A symbol.  `place` is None while undefined, a `Label`, or the value an equate gave it."""

    name: str
    place: Label | Known | None = None
    bind: Bind | None = None
    type: int = c.STT_NOTYPE
    size: Known | None = None
    visibility: int = c.STV_DEFAULT
    common: tuple[int, int] | None = None
    used: bool = False
    first_use: Place | None = field(default=None)
