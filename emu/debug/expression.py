"""Expressions of C on a machine that stands: `robot.speed[1]`, `*p`, `list->pid == 3`, `U1STA.TRMT`, `W3 + 2`.

What enters: a text and the frame it is meant in. What leaves: a `Value` where it names a place, else a number. Nothing
is changed. Names are looked up in this order: locals, the file's own, globals, symbols without type, enumerators,
registers (SFRs by their names and fields, `W0` to `W15`, `PC`), and `cycle`.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from functools import lru_cache
from typing import Any, Final

from emu.debug.inside import Frame, Inside, Value
from emu.debug.locate import Piece
from emu.debug.types import UNSIGNED, Type

TOKEN: Final = re.compile(
    r"\s*(?:(0[xX][0-9a-fA-F]+|0[bB][01]+|\d+\.\d+|\d+)[uUlL]*|'(\\?.)'|(\$?[A-Za-z_]\w*)"
    r"|(->|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^~!<>()\[\].?:]))"
)
WIDEST: Final = 64
"""Bits of the longest type: a shift by as many means nothing in C, and one by 10^10 would fill the memory."""
DEEPEST: Final = 50
"""Brackets and signs inside one another."""


def _within(bits: int) -> int:
    """A count of a shift. Raises ValueError."""
    if not 0 <= bits < WIDEST:
        raise ValueError(f"a shift by {bits} bits; expected 0 to {WIDEST - 1}")
    return bits


def _quotient(a: Any, b: Any) -> int:
    """Towards zero, as C divides; exact for whole numbers of any size."""
    if isinstance(a, float) or isinstance(b, float):
        return int(a / b)
    size: int = abs(a) // abs(b)
    return size if (a < 0) == (b < 0) else -size


BINARY: Final[dict[str, tuple[int, Callable[[Any, Any], Any]]]] = {
    "||": (1, lambda a, b: int(bool(a) or bool(b))),
    "&&": (2, lambda a, b: int(bool(a) and bool(b))),
    "|": (3, operator.or_),
    "^": (4, operator.xor),
    "&": (5, operator.and_),
    "==": (6, lambda a, b: int(a == b)),
    "!=": (6, lambda a, b: int(a != b)),
    "<": (7, lambda a, b: int(a < b)),
    ">": (7, lambda a, b: int(a > b)),
    "<=": (7, lambda a, b: int(a <= b)),
    ">=": (7, lambda a, b: int(a >= b)),
    "<<": (8, lambda a, b: operator.lshift(a, _within(b))),
    ">>": (8, lambda a, b: operator.rshift(a, _within(b))),
    "+": (9, operator.add),
    "-": (9, operator.sub),
    "*": (10, operator.mul),
    "/": (10, lambda a, b: a / b if isinstance(a, float) or isinstance(b, float) else _quotient(a, b)),
    "%": (10, lambda a, b: a - b * _quotient(a, b)),
}
WHOLE: Final = ("|", "^", "&", "<<", ">>", "%")
"""Operators for whole numbers only."""
ESCAPES: Final = {"n": 10, "r": 13, "t": 9, "0": 0, "\\": 92, "'": 39}


class ExpressionError(ValueError):
    """The text is no expression, or means nothing here."""


@lru_cache(maxsize=512)
def tokens(text: str) -> tuple[tuple[str, str], ...]:
    """(kind, text) of every token. Raises ExpressionError."""
    found, place = [], 0
    while text[place:].strip():
        match = TOKEN.match(text, place)
        if match is None:
            raise ExpressionError(f"{text!r}: {text[place:].strip()!r} is not understood")
        kind = ("number", "letter", "name", "sign")[(match.lastindex or 1) - 1]
        found.append((kind, match[match.lastindex or 1]))
        place = match.end()
    if not found:
        raise ExpressionError("an empty expression")
    return tuple(found)


def evaluate(inside: Inside, text: str, frame: Frame | None = None) -> Value | int | float:
    """What `text` means in `frame`. Raises ExpressionError, locate.Unavailable."""
    parser = _Parser(inside, text, frame)
    result: Value | int | float = parser.expression(0)
    if parser.at < len(parser.tokens):
        raise ExpressionError(f"{text!r}: {parser.tokens[parser.at][1]!r} is too much")
    return result


def number_of(result: Value | int | float) -> Any:
    """As Python has it. Raises locate.Unavailable."""
    return result.get() if isinstance(result, Value) else result


class _Parser:
    """Precedence climbing; values are computed on the way, but for what C does not evaluate."""

    def __init__(self, inside: Inside, text: str, frame: Frame | None) -> None:
        self.inside: Final = inside
        self.text: Final = text
        self.frame: Final = frame
        self.tokens: Final = tokens(text)
        self.at = self.depth = 0
        self.skips = False
        """What is read now is not evaluated: its value is 0."""

    def _peek(self) -> str:
        return self.tokens[self.at][1] if self.at < len(self.tokens) and self.tokens[self.at][0] == "sign" else ""

    def _take(self, sign: str) -> bool:
        if self._peek() == sign:
            self.at += 1
            return True
        return False

    def _need(self, sign: str) -> None:
        if not self._take(sign):
            raise ExpressionError(f"{self.text!r}: expected {sign!r}")

    def expression(self, lowest: int) -> Any:
        left = self.unary()
        while (sign := self._peek()) in BINARY and BINARY[sign][0] > lowest:
            self.at += 1
            rank, compute = BINARY[sign]
            decides = {"||": True, "&&": False}.get(sign)
            right = self._unless(decides is not None and bool(self._number(left)) == decides, rank)
            left = self._computed(sign, compute, left, right)
        if not lowest and self._take("?"):
            holds = bool(self._number(left))
            yes = self._unless(not holds, 0)
            self._need(":")
            no = self._unless(holds, 0)
            return yes if holds else no
        return left

    def _unless(self, decided: bool, lowest: int) -> Any:
        """An expression that is not evaluated if it is `decided` without it."""
        before, self.skips = self.skips, self.skips or decided
        try:
            return self.expression(lowest)
        finally:
            self.skips = before

    def _computed(self, sign: str, compute: Callable[[Any, Any], Any], left: Any, right: Any) -> Any:
        if self.skips:
            return 0
        if sign in ("+", "-") and isinstance(left, Value) and left.type.bare.kind == "pointer":
            count = self._number(right)
            if isinstance(count, int) and not (isinstance(right, Value) and right.type.bare.kind == "pointer"):
                step = max(left.type.bare.target.bytes, 1) if left.type.bare.target is not None else 1
                return _constant(left.type, compute(self._number(left), count * step) & 0xFFFF, self.inside)
        try:
            one, other = self._number(left), self._number(right)
            if sign in WHOLE:
                self._whole(sign, one, other)
            return compute(one, other)
        except (ArithmeticError, TypeError, ValueError) as error:
            raise ExpressionError(f"{self.text!r}: {error}") from None

    def _number(self, value: Any) -> Any:
        if isinstance(value, Value):
            if value.type.bare.kind == "array" and value.address is not None:
                return value.address
            if not value.type.is_number:
                raise ExpressionError(f"{self.text!r}: a {value.type} is no number")
            return value.get()
        return value

    def _whole(self, sign: str, *numbers: Any) -> None:
        if any(isinstance(one, float) for one in numbers):
            raise ExpressionError(f"{self.text!r}: {sign} needs whole numbers")

    def unary(self) -> Any:
        self.depth += 1
        if self.depth > DEEPEST:
            raise ExpressionError(f"more than {DEEPEST} brackets or signs inside one another")
        try:
            return self._signed()
        finally:
            self.depth -= 1

    def _signed(self) -> Any:
        if self._take("-"):
            return -self._number(self.unary())
        if self._take("+"):
            return self._number(self.unary())
        if self._take("~"):
            number = self._number(self.unary())
            self._whole("~", number)
            return ~number
        if self._take("!"):
            return int(not self._number(self.unary()))
        if self._take("*"):
            return self._part(self.unary(), 0)
        if self._take("&"):
            return self._address(self.unary())
        return self.postfix()

    def _address(self, value: Any) -> Value | int:
        if self.skips:
            return 0
        if not isinstance(value, Value) or value.address is None:
            raise ExpressionError(f"{self.text!r}: that has no address")
        return _constant(Type("pointer", size=2, target=value.type), value.address, self.inside)

    def postfix(self) -> Any:
        value = self.primary()
        while True:
            if self._take("["):
                index = self._number(self.expression(0))
                self._need("]")
                self._whole("[]", index)
                value = self._part(value, index)
            elif self._take("->"):
                value = self._part(self._part(value, 0), self._name())
            elif self._take("."):
                value = self._part(value, self._name())
            else:
                return value

    def _part(self, value: Any, part: str | int) -> Value | int:
        if self.skips:
            return 0
        if isinstance(value, int) and part == 0:
            return Value(UNSIGNED[2], (Piece("memory", value & 0xFFFF),), self.inside.view(self.frame), "")
        if not isinstance(value, Value):
            raise ExpressionError(f"{self.text!r}: a number has no parts")
        sfr = self.inside.image.chip.sfrs.get(value.name) if isinstance(part, str) else None
        if sfr is not None and part in sfr.fields:
            lsb, width = sfr.fields[str(part)]
            return Value(value.type, value.pieces, self.inside.view(self.frame), str(part), (width, lsb))
        try:
            return value[part]
        except (KeyError, TypeError) as error:
            raise ExpressionError(f"{self.text!r}: {error.args[0]}") from None

    def _name(self) -> str:
        if self.at < len(self.tokens) and self.tokens[self.at][0] == "name":
            self.at += 1
            return self.tokens[self.at - 1][1]
        raise ExpressionError(f"{self.text!r}: expected a name")

    def primary(self) -> Any:
        if self._take("("):
            value = self.expression(0)
            self._need(")")
            return value
        if self.at >= len(self.tokens):
            raise ExpressionError(f"{self.text!r}: it ends too early")
        kind, text = self.tokens[self.at]
        self.at += 1
        if kind == "number":
            return float(text) if "." in text else int(text, 0) if text.strip("0") else 0
        if kind == "letter":
            return ESCAPES.get(text[1], ord(text[1])) if len(text) == 2 else ord(text)
        if kind == "name":
            return self.named(text)
        raise ExpressionError(f"{self.text!r}: {text!r} is not expected there")

    def named(self, name: str) -> Any:
        if self.skips:
            return 0
        inside = self.inside
        variable = inside.variable(name, self.frame) if not name.startswith("$") else None
        if variable is not None:
            return inside.value(variable, self.frame)
        bare = name.removeprefix("$")
        register = re.fullmatch(r"[Ww](\d|1[0-5])", bare)
        sfr = inside.image.chip.sfrs.get(bare.removesuffix("bits"))
        symbol = inside.symbol(name) if not name.startswith("$") and not register and sfr is None else None
        if symbol is not None:
            return symbol
        if name in inside.debug.constants:
            return inside.debug.constants[name]
        if register is not None:
            return Value(UNSIGNED[2], (Piece("register", int(register[1])),), inside.view(self.frame), bare)
        if sfr is not None:
            place = (Piece("memory", sfr.address),)
            return Value(UNSIGNED[sfr.size], place, inside.view(self.frame), bare.removesuffix("bits"))
        if bare.lower() == "pc":
            return self.frame.pc if self.frame is not None else inside.machine.pc
        if bare == "cycle":
            return inside.machine.cycle
        function = inside.image.symbols.find(name)
        if function is not None:
            return function.address
        raise ExpressionError(f"there is nothing called {name!r} here")


def _constant(kind: Type, number: int, inside: Inside) -> Value:
    """A value that has no place."""
    return Value(kind, (Piece("value", 0, data=number.to_bytes(2, "little")),), inside.view())
