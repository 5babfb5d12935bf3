"""Filters of hooks: comparisons of memory with numbers that native code evaluates before it calls a hook.

A filter may only be false where the hook would do nothing. The hook itself decides when it is called.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

OPERATORS: Final = ("==", "!=", "<", "<=", ">", ">=")


@dataclass(frozen=True, slots=True)
class Comparison:
    """Comparison of the number at a RAM address with a constant."""

    address: int
    size: int
    """Size in bytes: 1, 2 or 4."""
    is_signed: bool
    operator: str
    """One of OPERATORS."""
    number: int


Filter = tuple[Comparison, ...]
"""Comparisons that must all hold."""
