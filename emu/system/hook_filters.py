"""Filters of hooks: comparisons of memory and registers with numbers that native code evaluates before it calls a hook.

A filter may only be false where the hook would do nothing. The hook itself decides when it is called.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

OPERATORS: Final = ("==", "!=", "<", "<=", ">", ">=")


@dataclass(frozen=True, slots=True)
class Comparison:
    """Comparison of a number in data space with a constant."""

    address: int
    """Data address of the number: in RAM, of a W register, or of an SFR. With `base`, the distance from its value."""
    size: int
    """Size in bytes: 1, 2 or 4."""
    is_signed: bool
    operator: str
    """One of OPERATORS."""
    number: int
    base: int | None = None
    """W register that holds the address of the function's frame; None for a fixed address."""
    field: tuple[int, int] | None = None
    """Width and least significant bit of a bit field; None for a whole number."""


Filter = tuple[Comparison, ...]
"""Comparisons that must all hold."""
