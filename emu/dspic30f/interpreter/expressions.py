"""Integer expressions as Python source text, each with the interval of its values.

Flow rules compute with plain operators, which `Expr` overloads. Values that are known at translation time stay Python
ints and are folded. By the interval of a value, masks without effect are omitted. Operands are atoms or parenthesised
text.
"""

from __future__ import annotations

from typing import Any, Final, TypeAlias

LIMIT: Final = 1 << 62
"""Bound on the magnitude of all values (engine contract). Wider intervals are clipped to it."""

Number: TypeAlias = "Expr | int"


class Expr:
    """Source text of an int in the range `low`..`high`. `atom` says whether the text is a name or a literal."""

    __slots__ = ("atom", "high", "low", "text")

    def __init__(self, text: str, low: int, high: int, atom: bool = False) -> None:
        self.text: Final = text
        self.low: Final = max(low, -LIMIT)
        self.high: Final = min(high, LIMIT)
        self.atom: Final = atom

    def __str__(self) -> str:
        return self.text if self.atom else f"({self.text})"

    def __add__(self, other: Any) -> Number:
        if other.__class__ is int and other == 0:
            return self
        low, high = interval(other)
        return Expr(f"{self} + {other}", self.low + low, self.high + high)

    def __radd__(self, other: int) -> Number:
        return self + other

    def __sub__(self, other: Any) -> Number:
        low, high = interval(other)
        return Expr(f"{self} - {other}", self.low - high, self.high - low)

    def __rsub__(self, other: int) -> Number:
        return Expr(f"{other} - {self}", other - self.high, other - self.low)

    def __neg__(self) -> Number:
        return Expr(f"-{self}", -self.high, -self.low)

    def __mul__(self, other: Any) -> Number:
        if other.__class__ is int and other == 1:
            return self
        low, high = interval(other)
        corners = [a * b for a in (self.low, self.high) for b in (low, high)]
        return Expr(f"{self} * {other}", min(corners), max(corners))

    __rmul__ = __mul__

    def __and__(self, other: Any) -> Number:
        low, high = interval(other)
        if other.__class__ is int:
            if other == 0:
                return 0
            if other > 0 and other & (other + 1) == 0 and self.low >= 0 and self.high <= other:
                return self
        if low < 0 and self.low < 0:
            return Expr(f"{self} & {other}", -LIMIT, LIMIT)
        highs = [bound for bound, least in ((self.high, self.low), (high, low)) if least >= 0]
        return Expr(f"{self} & {other}", 0, min(highs))

    __rand__ = __and__

    def __or__(self, other: Any) -> Number:
        if other.__class__ is int and other == 0:
            return self
        return self._bitwise("|", other)

    __ror__ = __or__

    def __xor__(self, other: Any) -> Number:
        if other.__class__ is int and other == 0:
            return self
        return self._bitwise("^", other)

    __rxor__ = __xor__

    def _bitwise(self, operator: str, other: Any) -> Number:
        low, high = interval(other)
        if self.low >= 0 and low >= 0:
            return Expr(f"{self} {operator} {other}", 0, (1 << max(self.high, high).bit_length()) - 1)
        size = 1 << max(abs(bound) for bound in (self.low, self.high, low, high)).bit_length()
        return Expr(f"{self} {operator} {other}", -size, size)

    def __invert__(self) -> Number:
        return Expr(f"~{self}", ~self.high, ~self.low)

    def __lshift__(self, other: Any) -> Number:
        if other.__class__ is int and other == 0:
            return self
        low, high = interval(other)
        corners = [bound << count for bound in (self.low, self.high) for count in (max(low, 0), min(max(high, 0), 62))]
        return Expr(f"{self} << {other}", min(corners), max(corners))

    def __rlshift__(self, other: int) -> Number:
        return Expr(f"{other} << {self}", 0 if other >= 0 else -LIMIT, LIMIT)

    def __rshift__(self, other: Any) -> Number:
        if other.__class__ is int and other == 0:
            return self
        low, high = interval(other)
        corners = [bound >> count for bound in (self.low, self.high) for count in (max(low, 0), max(high, 0))]
        return Expr(f"{self} >> {other}", min(corners), max(corners))

    def __rrshift__(self, other: int) -> Number:
        return Expr(f"{other} >> {self}", min(other, 0), max(other, 0))

    def _compare(self, operator: str, other: Any) -> Number:
        return Expr(f"{self} {operator} {other}", 0, 1)

    def __eq__(self, other: Any) -> Any:
        return self._compare("==", other)

    def __ne__(self, other: Any) -> Any:
        return self._compare("!=", other)

    def __lt__(self, other: Any) -> Any:
        return self._compare("<", other)

    def __le__(self, other: Any) -> Any:
        return self._compare("<=", other)

    def __gt__(self, other: Any) -> Any:
        return self._compare(">", other)

    def __ge__(self, other: Any) -> Any:
        return self._compare(">=", other)

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        raise TypeError(f"a rule branches on a value that is not static: {self.text}")


def interval(value: Number) -> tuple[int, int]:
    """Return the smallest and the largest possible value."""
    return (value.low, value.high) if isinstance(value, Expr) else (int(value), int(value))


def choose(condition: Number, yes: Number, no: Number) -> Number:
    """Return the expression that selects `yes` if `condition` is true, else `no`."""
    if not isinstance(condition, Expr):
        return yes if condition else no
    bounds = (*interval(yes), *interval(no))
    return Expr(f"{yes} if {condition} else {no}", min(bounds), max(bounds))
