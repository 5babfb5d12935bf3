"""Access to a machine by C expressions that are evaluated in the innermost frame."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from emu.debug.expressions.expression import evaluate, number_of

if TYPE_CHECKING:
    from emu.debug.inspector import Inspector
    from emu.debug.value import Value


def read(inspector: Inspector, expression: str) -> Any:
    """Return the value of a C expression as a Python object: int, float, bool, list of elements, dict of members.

    Raises ExpressionError for invalid text, Unavailable for a value that was optimised out.
    """
    return number_of(_evaluated(inspector, expression))


def variable(inspector: Inspector, expression: str) -> Value:
    """Return the typed object denoted by a C expression. Raises as `read`, and ValueError for a plain number."""
    found = _evaluated(inspector, expression)
    if isinstance(found, (int, float)):
        raise ValueError(f"{expression!r} is the number {found} and names no object in memory or a register")
    return found


def _evaluated(inspector: Inspector, expression: str) -> Value | int | float:
    frames = inspector.frames()
    return evaluate(inspector, expression, frames[0] if frames else None)
