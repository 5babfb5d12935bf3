"""Breakpoints of all kinds: addresses, conditions, hit counts and log messages."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

from emu.debug.dwarf.location import Unavailable
from emu.debug.expressions.expression import ExpressionError, evaluate, number_of
from emu.debug.inspector import Inspector

HIT: Final = re.compile(r"\s*(==|>=|<=|>|<|%|=)?\s*(\d+)\s*")
COMPARE: Final[dict[str, Callable[[int, int], bool]]] = {
    "==": lambda count, n: count == n,
    "=": lambda count, n: count == n,
    ">": lambda count, n: count > n,
    ">=": lambda count, n: count >= n,
    "<": lambda count, n: count < n,
    "<=": lambda count, n: count <= n,
    "%": lambda count, n: n > 0 and count % n == 0,
}
IN_MESSAGE: Final = re.compile(r"\{([^{}]*)\}")

DEFINING_FIELDS: Final = ("kind", "addresses", "condition", "hit_condition", "message", "size", "access")


@dataclass(eq=False, slots=True)
class Breakpoint:
    """One breakpoint of a client. `addresses` are program addresses; for a data breakpoint, its first data address."""

    id: int
    kind: str
    """Kind of breakpoint: "source", "function", "instruction" or "data"."""
    addresses: tuple[int, ...]
    condition: str = ""
    hit_condition: str = ""
    message: str = ""
    size: int = 0
    access: str = "write"
    """Access at which a data breakpoint stops: "read", "write" or "readWrite"."""
    hits: int = 0
    facts: dict[str, Any] = field(default_factory=dict)
    """The breakpoint in the form that the protocol reports to the client."""

    def is_same(self, other: Breakpoint) -> bool:
        """Whether `other` is the same breakpoint, set again by the client."""
        return all(getattr(self, name) == getattr(other, name) for name in DEFINING_FIELDS)

    def should_stop(self, inspector: Inspector, write_output: Callable[[str], None]) -> bool:
        """Count a hit and return whether the run stops here.

        An invalid condition stops the run and is reported.
        """
        if self.condition:
            try:
                frames = inspector.frames()
                if not number_of(evaluate(inspector, self.condition, frames[0] if frames else None)):
                    return False
            except (ExpressionError, Unavailable) as error:
                write_output(f"condition {self.condition!r}: {error}\n")
                return True
        self.hits += 1
        match = HIT.fullmatch(self.hit_condition) if self.hit_condition else None
        if match is not None and not COMPARE[match[1] or "=="](self.hits, int(match[2])):
            return False
        if self.message:
            write_output(formatted_message(inspector, self.message) + "\n")
            return False
        return True


def formatted_message(inspector: Inspector, message: str) -> str:
    """Return a log message with each expression in braces replaced by its value."""
    frames = inspector.frames()

    def value(match: re.Match[str]) -> str:
        try:
            found = evaluate(inspector, match[1], frames[0] if frames else None)
            return found.text() if not isinstance(found, (int, float)) else str(found)
        except (ExpressionError, Unavailable) as error:
            return f"<{error}>"

    return IN_MESSAGE.sub(value, message)


def hit_condition_error(text: str) -> str:
    """Return why a hit condition is invalid, empty if it is valid."""
    return "" if not text or HIT.fullmatch(text) else f"expected N, ==N, >N, >=N, <N, <=N or %N, not {text!r}"
