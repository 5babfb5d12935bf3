"""Comparison of a number with a constant, as LLVM IR: part of a hook's condition or of a watched number."""

from __future__ import annotations

from collections.abc import Callable
from operator import eq, ge, gt, le, lt, ne
from typing import Any, Final

from emu.dspic30f.jit.ir.values import Number
from emu.system.hook_filters import Comparison

_COMPARE: Final[dict[str, Callable[[Any, Any], Any]]] = {"==": eq, "!=": ne, "<": lt, "<=": le, ">": gt, ">=": ge}


def compare(one: Comparison, value: Number) -> Number:
    """Emit the comparison of `value`, which has `one.size` bytes, or of its bit field `one.field`, with a constant."""
    bits = 8 * one.size
    if one.field is not None:
        bits, lsb = one.field
        value = (value >> lsb) & ((1 << bits) - 1)
    if one.is_signed:
        value = (value ^ 1 << bits - 1) - (1 << bits - 1)
    result: Number = _COMPARE[one.operator](value, one.number)
    return result
