"""Lanes of vector values as operands."""

from __future__ import annotations

from toolchain.ir.model import Value


class Lane(Value):
    """One lane of a vector value, resolved when its legal value is asked for."""

    __slots__ = ("index", "source")

    def __init__(self, source: Value, index: int) -> None:
        super().__init__(source.type.elems[0])
        self.source = source
        self.index = index
