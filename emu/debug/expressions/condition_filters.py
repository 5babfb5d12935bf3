"""Filters of conditional breakpoints: conditions that native code can evaluate (emu/system/hook_filters.py).

A conjunction of comparisons of numbers with constants becomes a filter. A number is a variable, a member, an element at
a constant index, a W register, an SFR or a field of one. Every other condition is evaluated by `expression.evaluate` at
each arrival. A filter that holds is followed by that evaluation, too.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from emu.debug.dwarf.location import Unavailable
from emu.debug.expressions.expression import ExpressionError, evaluate, tokens
from emu.debug.frame import Frame
from emu.debug.inspector import Inspector
from emu.debug.unwind import REGISTERS
from emu.debug.value import Value
from emu.system.hook_filters import OPERATORS, Comparison, Filter

_MIRRORED: Final = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}
_INT_BITS: Final = 16
_W_END: Final = 2 * REGISTERS
"""First data address after the memory-mapped W registers (isa.md §1.2)."""
_PROBES: Final = tuple(tuple(0x2000 + 0x100 * n + step * (n + 1) for n in range(REGISTERS)) for step in (0, 2))
"""Two sets of register values. An address that moves by 2 (n + 1) between them has a constant distance from Wn."""
Token = tuple[str, str]


def filter_of(inspector: Inspector, condition: str, address: int | None = None) -> Filter | None:
    """Return the filter of a condition at a program address, None if it has none.

    Without an address, the condition may name globals and registers only.
    """
    try:
        found = tokens(condition)
        parts: list[list[Token]] = [[]]
        for token in found:
            if token == ("sign", "&&"):
                parts.append([])
            else:
                parts[-1].append(token)
        comparisons = [_comparison(inspector, part, address) for part in parts]
    except (ExpressionError, Unavailable, IndexError):
        return None
    known = tuple(one for one in comparisons if one is not None)
    return known if len(known) == len(parts) else None


def _comparison(inspector: Inspector, part: list[Token], address: int | None) -> Comparison | None:
    """Return one comparison, None if it is of another form."""
    if part[0] == ("sign", "!"):
        return _literal_comparison(inspector, part[1:], "==", "0", address)
    places = [number for number, (kind, text) in enumerate(part) if kind == "sign" and text in OPERATORS]
    if not places:
        return _literal_comparison(inspector, part, "!=", "0", address)
    operator, left, right = part[places[0]][1], part[: places[0]], part[places[0] + 1 :]
    if left[0][0] == "number":
        left, right, operator = right, left, _MIRRORED.get(operator, operator)
    match right:
        case [("number", literal)]:
            return _literal_comparison(inspector, left, operator, literal, address)
        case [("sign", "-"), ("number", literal)]:
            return _literal_comparison(inspector, left, operator, "-" + literal, address)
    return None


def _literal_comparison(
    inspector: Inspector, operand: list[Token], operator: str, literal: str, address: int | None
) -> Comparison | None:
    """Return the comparison of an operand with a literal, if C compares the two as mathematics does."""
    place = _operand_comparison(inspector, operand, address)
    if place is None:
        return None
    try:
        number = int(literal.rstrip("lL"), 0)
    except ValueError:  # the literal has a suffix `u`, or is octal
        return None
    bits = max(8 * place.size, _INT_BITS)
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if place.is_signed else (0, (1 << bits) - 1)
    return replace(place, operator=operator, number=number) if low <= number <= high else None


def _operand_comparison(inspector: Inspector, operand: list[Token], address: int | None) -> Comparison | None:
    """Return a comparison with only the location of an operand filled in; None if the location depends on memory."""
    if address is None:
        found = _object(inspector, operand, None)
        return None if found is None else _comparison_of(inspector, found, None)
    one, other = (_object(inspector, operand, frame) for frame in _frames(inspector, address))
    if one is None or other is None:
        return None
    if one.address == other.address or one.address is None or other.address is None:
        return _comparison_of(inspector, one, None)
    base, rest = divmod(other.address - one.address, 2)
    return None if rest or not 0 < base <= REGISTERS else _comparison_of(inspector, one, base - 1)


def _frames(inspector: Inspector, address: int) -> tuple[Frame | None, Frame | None]:
    """Return the innermost frame at a program address for each of the two sets of register values."""
    one, other = (next(iter(inspector.frames(address, values)), None) for values in _PROBES)
    return one, other


def _object(inspector: Inspector, operand: list[Token], frame: Frame | None) -> Value | None:
    """Return the object that `name`, `name.member` or `name[number]` denotes in a frame, in any depth."""
    end = 1
    while end <= len(operand):
        text = "".join(text for _, text in operand[:end])
        found = evaluate(inspector, text, frame) if operand[0][0] == "name" else None
        if not isinstance(found, Value):
            return None
        match operand[end : end + 3]:
            case []:
                return found
            case [("sign", "."), ("name", _), *_]:
                end += 2
            case [("sign", "["), ("number", _), ("sign", "]")] if found.type.bare.kind == "array":
                end += 3
            case _:
                return None
    return None


def _comparison_of(inspector: Inspector, found: Value, base: int | None) -> Comparison | None:
    """Return a comparison with only the location of a number filled in; None if native code cannot read the number.

    With `base`, its address lies at a constant distance from the value of that W register.
    """
    bare, size = found.type.bare, found.type.bytes
    if bare.kind not in ("signed", "unsigned", "char", "bool") or size not in (1, 2, 4) or len(found.pieces) != 1:
        return None
    is_signed = bare.kind == "signed" or (bare.kind == "char" and bare.is_signed)
    piece, chip = found.pieces[0], inspector.machine.chip
    if piece.kind == "register" and base is None and piece.at + (size > 2) < REGISTERS:
        return Comparison(2 * piece.at + piece.skip, size, is_signed, "==", 0, field=found.bits)
    if piece.kind != "memory":
        return None
    if base is not None:
        return Comparison(piece.at - _PROBES[0][base], size, is_signed, "==", 0, base, found.bits)
    ram, place = chip.data["ram"], piece.at
    in_ram = place in ram and place + size <= ram.end
    if not in_ram and not (_W_END <= place < ram.start and place + size <= (place & ~1) + 2):
        return None
    return Comparison(place, size, is_signed, "==", 0, None, found.bits)
