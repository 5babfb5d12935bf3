"""Filters of conditional breakpoints: conditions that native code can evaluate (emu/system/filters.py).

Only a conjunction of comparisons of global variables with constants becomes a filter; every other condition is
evaluated by `expression.evaluate` at each arrival. A filter that holds is followed by that evaluation, too.
"""

from __future__ import annotations

from typing import Final

from emu.debug.dwarf.location import Unavailable
from emu.debug.dwarf.units import Scope, Variable
from emu.debug.expressions.expression import ExpressionError, tokens
from emu.debug.inspector import Inspector
from emu.system.filters import OPERATORS, Comparison, Filter

_MIRRORED: Final = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}
_INT_BITS: Final = 16
Token = tuple[str, str]


def filter_of(inspector: Inspector, condition: str, address: int) -> Filter | None:
    """Return the filter of a breakpoint's condition at a program address, None if it has none."""
    try:
        found = tokens(condition)
    except ExpressionError:
        return None
    parts: list[list[Token]] = [[]]
    for token in found:
        if token == ("sign", "&&"):
            parts.append([])
        else:
            parts[-1].append(token)
    comparisons = [_comparison(inspector, part, address) for part in parts]
    known = tuple(one for one in comparisons if one is not None)
    return known if len(known) == len(parts) else None


def _comparison(inspector: Inspector, part: list[Token], address: int) -> Comparison | None:
    """Return one comparison, None if it is of another form."""
    texts = [text for _, text in part]
    match [kind for kind, _ in part]:
        case ["name"]:
            return _made(inspector, texts[0], "!=", "0", address)
        case ["sign", "name"] if texts[0] == "!":
            return _made(inspector, texts[1], "==", "0", address)
        case ["name", "sign", "number"]:
            return _made(inspector, texts[0], texts[1], texts[2], address)
        case ["name", "sign", "sign", "number"] if texts[2] == "-":
            return _made(inspector, texts[0], texts[1], "-" + texts[3], address)
        case ["number", "sign", "name"]:
            return _made(inspector, texts[2], _MIRRORED.get(texts[1], texts[1]), texts[0], address)
    return None


def _made(inspector: Inspector, name: str, operator: str, literal: str, address: int) -> Comparison | None:
    """Return the comparison of a variable with a literal, if C compares the two as mathematics does."""
    variable = _global(inspector, name, address)
    if operator not in OPERATORS or variable is None:
        return None
    try:
        place = inspector.value(variable).address
    except Unavailable:
        return None
    bare, size = variable.type.bare, variable.type.bytes
    is_signed = bare.kind == "signed" or (bare.kind == "char" and bare.is_signed)
    ram = inspector.machine.chip.data["ram"]
    if place is None or bare.kind not in ("signed", "unsigned", "char", "bool") or size not in (1, 2, 4):
        return None
    try:
        number = int(literal.rstrip("lL"), 0)
    except ValueError:  # a suffix `u`, or an octal number
        return None
    bits = max(8 * size, _INT_BITS)
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if is_signed else (0, (1 << bits) - 1)
    if not low <= number <= high or place not in ram or place + size > ram.end:
        return None
    return Comparison(place, size, is_signed, operator, number)


def _global(inspector: Inspector, name: str, address: int) -> Variable | None:
    """Return the variable outside functions that `name` denotes at a program address, None if a local may hide it."""
    function = inspector.debug.function(address)
    if function is None or _declares(function, name):
        return None
    mine = inspector.debug.statics.get(function.unit, {}).get(name)
    same_name = inspector.debug.globals.get(name, [])
    return mine or (same_name[0] if same_name else None)


def _declares(scope: Scope, name: str) -> bool:
    return any(one.name == name for one in scope.variables) or any(_declares(inner, name) for inner in scope.inner)
