"""Conditional assembly: .if, .ifdef, .elseif, .else, .endif and variants (GNU as 2.14)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Protocol

from toolchain.asm.expr import ExprError
from toolchain.asm.macro import split_arguments
from toolchain.asm.symbols import AsmSymbol
from toolchain.errors import SourceLocation

_COMPARISONS = (".if", ".ifne", ".ifeq", ".ifgt", ".ifge", ".iflt", ".ifle")
_TESTS = (".ifdef", ".ifndef", ".ifnotdef", ".ifdecl", ".ifndecl", ".ifc", ".ifnc", ".ifeqs", ".ifnes")
_PARTS = (".else", ".elsec", ".elseif", ".endif", ".endc")
CONDITIONALS = frozenset(_COMPARISONS + _TESTS + _PARTS)


class ConditionContext(Protocol):
    """Interface of the assembler to conditions: the state on which they depend."""

    symbols: dict[str, AsmSymbol]
    declared: set[str]
    registers: dict[str, str]

    def constant(self, text: str, what: str = "expression") -> int:
        """Return the value of `text`; raise `ExprError` if it is not yet a number."""


@dataclass(slots=True)
class _Level:
    place: SourceLocation
    active: bool
    taken: bool  # whether a branch of this .if has been assembled, or the whole .if lies in skipped text
    had_else: bool = False


_COMPARE = {
    ".if": lambda v: v != 0, ".ifne": lambda v: v != 0, ".ifeq": lambda v: v == 0, ".ifgt": lambda v: v > 0,
    ".ifge": lambda v: v >= 0, ".iflt": lambda v: v < 0, ".ifle": lambda v: v <= 0,
}  # fmt: skip


class Conditionals:
    """Stack of open conditionals; `active`: whether the current line is assembled."""

    def __init__(self) -> None:
        self._levels: list[_Level] = []
        self.active = True

    @property
    def depth(self) -> int:
        return len(self._levels)

    def innermost(self) -> SourceLocation | None:
        """Return the source position of the innermost open .if."""
        return self._levels[-1].place if self._levels else None

    def cut(self, depth: int) -> None:
        """Close all conditionals deeper than `depth` (end of a file, .exitm)."""
        del self._levels[depth:]
        self._update()

    def _update(self) -> None:
        self.active = all(level.active for level in self._levels[-1:])

    def process(self, word: str, operands: str, place: SourceLocation, context: ConditionContext) -> None:
        """Process one conditional directive."""
        if word in (".else", ".elsec"):
            level = self._top(word)
            if level.had_else:
                raise ExprError("second .else of one .if")
            level.had_else = True
            level.active, level.taken = not level.taken, True
        elif word == ".elseif":
            level = self._top(word)
            if level.had_else:
                raise ExprError(".elseif after .else")
            level.active = not level.taken and context.constant(operands, "condition") != 0
            level.taken = level.taken or level.active
        elif word in (".endif", ".endc"):
            self._top(word)
            self._levels.pop()
        elif not self.active:
            self._levels.append(_Level(place, False, True))
        else:
            self._levels.append(_Level(place, False, True))  # inactive until evaluated, and if an error occurs
            truth = _condition(word, operands, context)
            self._levels[-1] = _Level(place, truth, truth)
        self._update()

    def _top(self, word: str) -> _Level:
        if not self._levels:
            raise ExprError(f"{word} without .if")
        return self._levels[-1]


def _condition(word: str, operands: str, context: ConditionContext) -> bool:
    if word in _COMPARE:
        return bool(_COMPARE[word](context.constant(operands, "condition")))
    if word in (".ifdef", ".ifndef", ".ifnotdef", ".ifdecl", ".ifndecl"):
        name = operands.strip()
        if not re.fullmatch(r"[A-Za-z_.$][\w.$]*", name):
            raise ExprError(f"{word} expects one symbol, got {name!r}")
        symbol = context.symbols.get(name)
        if name in context.registers:
            return word in (".ifdef", ".ifdecl")
        if word.endswith("decl"):  # .ifdecl: true if the symbol has occurred before, defined or not
            return (symbol is not None or name in context.declared) == (word == ".ifdecl")
        defined = symbol is not None and (symbol.place is not None or symbol.common is not None)
        return defined == (word == ".ifdef")
    parts = split_arguments(operands, spaces=False)
    if len(parts) != 2:
        raise ExprError(f"{word} expects two strings separated by a comma")
    return (parts[0] == parts[1]) == (word in (".ifc", ".ifeqs"))
