"""Lanes of vectors as operands of scalar instructions."""

from __future__ import annotations

from toolchain.ir.model import Value


class Lane(Value):
    """One lane of a vector; `LegalizationContext.legal` returns its legal value."""

    __slots__ = ("index", "source")

    def __init__(self, source: Value, index: int) -> None:
        super().__init__(source.type.elems[0])
        self.source = source
        self.index = index
