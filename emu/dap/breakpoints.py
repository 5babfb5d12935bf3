"""Breakpoints of all kinds: where they are, when they count, what they say."""

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

SAME: Final = ("kind", "places", "condition", "hit_condition", "message", "size", "access")


@dataclass(eq=False, slots=True)
class Breakpoint:
    """One entry of a client's list. `places`: program addresses, or the first data address of a data breakpoint."""

    id: int
    kind: str
    """"source", "function", "instruction" or "data"."""
    places: tuple[int, ...]
    condition: str = ""
    hit_condition: str = ""
    message: str = ""
    size: int = 0
    access: str = "write"
    """Of a data breakpoint: "read", "write" or "readWrite"."""
    hits: int = 0
    facts: dict[str, Any] = field(default_factory=dict)
    """What the client was told about it."""

    def is_as(self, other: Breakpoint) -> bool:
        """Whether it is the same one, told again."""
        return all(getattr(self, name) == getattr(other, name) for name in SAME)

    def stops(self, inspector: Inspector, say: Callable[[str], None]) -> bool:
        """Whether a run ends here, now that it has come by. A condition that means nothing ends it, and says why."""
        if self.condition:
            try:
                frames = inspector.frames()
                if not number_of(evaluate(inspector, self.condition, frames[0] if frames else None)):
                    return False
            except (ExpressionError, Unavailable) as error:
                say(f"condition {self.condition!r}: {error}\n")
                return True
        self.hits += 1
        match = HIT.fullmatch(self.hit_condition) if self.hit_condition else None
        if match is not None and not COMPARE[match[1] or "=="](self.hits, int(match[2])):
            return False
        if self.message:
            say(filled(inspector, self.message) + "\n")
            return False
        return True


def filled(inspector: Inspector, message: str) -> str:
    """A log message with the values of the expressions in braces."""
    frames = inspector.frames()

    def value(match: re.Match[str]) -> str:
        try:
            found = evaluate(inspector, match[1], frames[0] if frames else None)
            return found.text() if not isinstance(found, (int, float)) else str(found)
        except (ExpressionError, Unavailable) as error:
            return f"<{error}>"

    return IN_MESSAGE.sub(value, message)


def bad_hit_condition(text: str) -> str:
    """What is wrong with a hit condition, empty if nothing is."""
    return "" if not text or HIT.fullmatch(text) else f"{text!r} is none of N, ==N, >N, >=N, <N, <=N, %N"
