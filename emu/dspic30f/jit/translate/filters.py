"""Filters of hooks as LLVM IR (emu/system/filters.py)."""

from __future__ import annotations

from collections.abc import Callable
from operator import eq, ge, gt, le, lt, ne
from typing import Any, Final

from emu.dspic30f.jit.translate.values import Emitter, Number
from emu.dspic30f.jit.translate.variables import pointer
from emu.system.filters import Comparison, Filter

_COMPARE: Final[dict[str, Callable[[Any, Any], Any]]] = {"==": eq, "!=": ne, "<": lt, "<=": le, ">": gt, ">=": ge}


def some_filter_holds(e: Emitter, filters: tuple[Filter, ...]) -> Number:
    """Emit the evaluation of filters and return whether at least one holds."""
    result: Number = 0
    for comparisons in filters:
        holds: Number = 1
        for one in comparisons:
            holds = _comparison(e, one) & holds
        result = holds | result
    return result


def _comparison(e: Emitter, one: Comparison) -> Number:
    bits = 8 * one.size
    value: Number = e.load(pointer(e, one.address), bits)
    if one.is_signed:
        value = (value ^ 1 << bits - 1) - (1 << bits - 1)
    result: Number = _COMPARE[one.operator](value, one.number)
    return result
