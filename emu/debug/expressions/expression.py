"""Expressions of C on a machine that stands: `robot.speed[1]`, `*p`, `list->pid == 3`, `U1STA.TRMT`, `W3 + 2`.

What enters: a text and the frame it is meant in. What leaves: a `Value` where it names a place, else a number. Nothing
is changed. Names are looked up in this order: locals, the file's own, globals, symbols without type, enumerators,
registers (SFRs by their names and fields, `W0` to `W15`, `PC`), and `cycle`. Numbers are computed as C does
(`numbers.py`): `now - then` of two unsigned ints is one, pointers count in what they point to. Casts and `sizeof`
take names of types as the program and C have them (`typenames.py`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, Final

from emu.debug.dwarf.location import Piece
from emu.debug.dwarf.types import UNSIGNED, Type, encode
from emu.debug.expressions.arithmetic import (
    BINARY,
    FLOAT,
    FLOATING,
    INT,
    Number,
    common,
    complemented,
    computed,
    converted,
    negated,
    promoted,
    whole,
)
from emu.debug.expressions.type_names import TypeNameError, type_name
from emu.debug.inspector import Frame, Inspector, Value

TOKEN: Final = re.compile(
    r"\s*(?:((?:\d+\.\d*|\.\d+)(?:[eE][-+]?\d+)?[fFlL]?|\d+[eE][-+]?\d+[fFlL]?)|((?:0[xX][0-9a-fA-F]+|0[bB][01]+|\d+)[uUlL]*)"
    r"|'(\\x[0-9a-fA-F]+|\\[0-7]{1,3}|\\.|[^'\\])'|(\$?[A-Za-z_]\w*)"
    r"|(->|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^~!<>()\[\].?:]))"
)
KINDS: Final = ("fraction", "number", "letter", "name", "sign")
"""Of the groups of TOKEN."""
DEEPEST: Final = 50
"""Brackets, signs and choices inside one another."""
ESCAPES: Final = dict(zip("abfnrtv\\'\"?", (7, 8, 12, 10, 13, 9, 11, 92, 39, 34, 63), strict=True))


NOTHING: Final = Number(0)
"""What is not evaluated."""


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
        kind = KINDS[(match.lastindex or 1) - 1]
        found.append((kind, match[match.lastindex or 1]))
        place = match.end()
    if not found:
        raise ExpressionError("an empty expression")
    return tuple(found)


def evaluate(inspector: Inspector, text: str, frame: Frame | None = None) -> Value | int | float:
    """What `text` means in `frame`. Raises ExpressionError, locate.Unavailable."""
    parser = _Parser(inspector, text, frame)
    result = parser.expression(0)
    if parser.at < len(parser.tokens):
        raise ExpressionError(f"{text!r}: {parser.tokens[parser.at][1]!r} is too much")
    found: Value | int | float = result.value if isinstance(result, Number) else result
    return found


def number_of(result: Value | int | float) -> Any:
    """As Python has it. Raises locate.Unavailable."""
    return result.get() if isinstance(result, Value) else result


class _Parser:
    """Precedence climbing; values are computed on the way, but for what C does not evaluate."""

    def __init__(self, inspector: Inspector, text: str, frame: Frame | None) -> None:
        self.inspector: Final = inspector
        self.text: Final = text
        self.frame: Final = frame
        self.tokens: Final = tokens(text)
        self.at = self.depth = 0
        self.evaluates = True
        """If not, what is read now has a type, but no value: nothing is looked up in the machine."""
        self.forgives = False
        """What means nothing is 0: what C would not evaluate may name what is not there."""

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
            decides = {"||": True, "&&": False}.get(sign)
            right = self._unless(decides is not None and bool(self._number(left).value) == decides, BINARY[sign][0])
            left = self._computed(sign, left, right)
        if not lowest and self._take("?"):
            with self._deeper():
                holds = bool(self._number(left).value)
                yes = self._unless(not holds, 0)
                self._need(":")
                no = self._unless(holds, 0)
                return self._chosen(yes, no) if holds else self._chosen(no, yes)
        return left

    def _chosen(self, taken: Any, other: Any) -> Any:
        """The operand of a choice that was taken, in the type of both (C11 §6.5.15)."""
        if not (self._is_arithmetic(taken) and self._is_arithmetic(other)):
            return taken
        if isinstance(taken, Value) and isinstance(other, Value) and taken.type is other.type:
            return taken
        number = self._number(taken)
        with self._only_typed():
            kind = common(number.kind, self._number(other).kind)
        return Number(converted(number.value, kind), kind)

    def _is_arithmetic(self, value: Any) -> bool:
        return isinstance(value, Number) or (value.type.is_number and not _points(value))

    @contextmanager
    def _deeper(self) -> Iterator[None]:
        """Inside of something. Raises ExpressionError beyond DEEPEST."""
        self.depth += 1
        if self.depth > DEEPEST:
            raise ExpressionError(f"more than {DEEPEST} brackets or signs inside one another")
        try:
            yield
        finally:
            self.depth -= 1

    @contextmanager
    def _only_typed(self, forgives: bool | None = None) -> Iterator[None]:
        """What is read within is not evaluated."""
        before = self.evaluates, self.forgives
        self.evaluates, self.forgives = False, self.forgives if forgives is None else forgives
        try:
            yield
        finally:
            self.evaluates, self.forgives = before

    def _unless(self, decided: bool, lowest: int) -> Any:
        """An expression that is not evaluated if it is `decided` without it."""
        if not decided:
            return self.expression(lowest)
        with self._only_typed(forgives=True):
            return self.expression(lowest)

    def _refused(self, why: object) -> Number:
        """Raises ExpressionError, unless what means nothing is forgiven."""
        if self.forgives:
            return NOTHING
        raise ExpressionError(f"{self.text!r}: {why}")

    def _read(self, value: Value) -> Any:
        """What a place holds; 1 where nothing is evaluated, as that can be computed with everywhere."""
        return value.get() if self.evaluates else 1.0 if value.type.bare.kind == "float" else 1

    def _typed(self, kind: Type, name: str = "", bits: tuple[int, int] | None = None) -> Value:
        """A place that is not known, as nothing is evaluated."""
        return Value(kind, (Piece("gone", 0),), self.inspector.view(self.frame), name, bits)

    def _computed(self, sign: str, left: Any, right: Any) -> Any:
        one, other = self._decayed(left), self._decayed(right)
        if sign == "+" and _points(other) and not _points(one):
            one, other = other, one
        try:
            if sign in ("+", "-") and _points(one):
                step = max(one.type.bare.target.bytes, 1) if one.type.bare.target is not None else 1
                if not _points(other):
                    distance = self._whole(sign, self._number(other)) * step
                    address = self._read(one) + (distance if sign == "+" else -distance)
                    return _constant(one.type, address & 0xFFFF, self.inspector)
                if sign == "-":
                    return computed("/", Number(self._read(one) - self._read(other)), Number(step))
            return computed(sign, self._number(one), self._number(other))
        except (ArithmeticError, TypeError, ValueError) as error:
            return self._refused(error)

    def _decayed(self, value: Any) -> Any:
        """An array is a pointer to its first element where a number is meant."""
        if isinstance(value, Value) and value.type.bare.kind == "array":
            pointer = Type("pointer", size=2, target=value.type.bare.target)
            if not self.evaluates:
                return self._typed(pointer)
            if value.address is not None:
                return _constant(pointer, value.address, self.inspector)
        return value

    def _number(self, value: Any) -> Number:
        value = self._decayed(value)
        if isinstance(value, Value):
            if not value.type.is_number:
                return self._refused(f"a {value.type} is no number")
            return promoted(self._read(value), value.type, value.bits[0] if value.bits is not None else 0)
        assert isinstance(value, Number)
        return value if self.evaluates else Number(type(value.value)(1), value.kind)

    def _whole(self, sign: str, number: Number) -> int:
        if not isinstance(number.value, int):
            return int(self._refused(f"{sign} needs whole numbers").value)
        return number.value

    def unary(self) -> Any:
        with self._deeper():
            return self._signed()

    def _signed(self) -> Any:
        if (kind := self._bracketed_type()) is not None:
            return self._cast(kind, self.unary())
        if self.at < len(self.tokens) and self.tokens[self.at] == ("name", "sizeof"):
            self.at += 1
            return self._size()
        if self._take("-"):
            return negated(self._number(self.unary()))
        if self._take("+"):
            return self._number(self.unary())
        if self._take("~"):
            number = self._number(self.unary())
            return complemented(number) if number.is_whole else self._refused("~ needs whole numbers")
        if self._take("!"):
            return Number(int(not self._number(self.unary()).value))
        if self._take("*"):
            return self._part(self.unary(), 0)
        if self._take("&"):
            return self._address(self.unary())
        return self.postfix()

    def _bracketed_type(self) -> Type | None:
        """The type whose name comes next in brackets, if that does."""
        if self._peek() != "(":
            return None
        try:
            found = type_name(self.tokens, self.at + 1, self._type_called)
        except TypeNameError as error:
            raise ExpressionError(f"{self.text!r}: {error}") from None
        if found is None:
            return None
        self.at = found[1]
        self._need(")")
        return found[0]

    def _type_called(self, name: str) -> Type | None:
        """What the program calls so, where it is no variable."""
        unit = self.frame.scopes[0].unit if self.frame is not None and self.frame.scopes else -1
        return None if self.inspector.variable(name, self.frame) is not None else self.inspector.debug.type(name, unit)

    def _size(self) -> Number:
        """What stands behind `sizeof`, which is not evaluated."""
        kind = self._bracketed_type()
        if kind is None:
            with self._only_typed():
                value = self.unary()
            if isinstance(value, Value) and value.bits is not None:
                return self._refused("a bit field has no size")
            kind = value.kind if isinstance(value, Number) else value.type
        if not kind.bytes:
            return self._refused(f"the size of {kind} is not known")
        return whole(kind.bytes, unsigned=True)

    def _cast(self, kind: Type, value: Any) -> Any:
        one = self._decayed(value)
        if isinstance(one, Value) and one.type.bare is kind.bare:
            return one
        if not kind.is_number or (isinstance(one, Value) and not one.type.is_number):
            return self._refused(f"what is {one.type if isinstance(one, Value) else 'a number'} is no {kind}")
        try:
            plain = self._read(one) if isinstance(one, Value) else one.value
            return _constant(kind, converted(plain, kind), self.inspector)
        except ValueError as error:
            return self._refused(error)

    def _address(self, value: Any) -> Value | Number:
        if isinstance(value, Value) and value.bits is None and not self.evaluates:
            return self._typed(Type("pointer", size=2, target=value.type))
        if not isinstance(value, Value) or value.address is None or value.bits is not None:
            return self._refused("that has no address")
        return _constant(Type("pointer", size=2, target=value.type), value.address, self.inspector)

    def postfix(self) -> Any:
        value = self.primary()
        while True:
            if self._take("["):
                index = self.expression(0)
                self._need("]")
                if isinstance(value, Number) and _points(self._decayed(index)):
                    value, index = index, value
                value = self._part(value, self._whole("[]", self._number(index)))
            elif self._take("->"):
                value = self._part(self._part(value, 0), self._name())
            elif self._take("."):
                value = self._part(value, self._name())
            else:
                return value

    def _part(self, value: Any, part: str | int) -> Value | Number:
        if isinstance(value, Number) and isinstance(value.value, int) and part == 0:
            return Value(UNSIGNED[2], (Piece("memory", value.value & 0xFFFF),), self.inspector.view(self.frame), "")
        if not isinstance(value, Value):
            return self._refused("a number has no parts")
        sfr = self.inspector.image.chip.sfrs.get(value.name) if isinstance(part, str) else None
        if sfr is not None and part in sfr.fields:
            lsb, width = sfr.fields[str(part)]
            return Value(value.type, value.pieces, self.inspector.view(self.frame), str(part), (width, lsb))
        if not isinstance(part, str) and (target := value.type.bare.target) is not None:
            if target.bare.kind in ("void", "function"):
                return self._refused(f"what a {value.type} points to has no value")
            if not self.evaluates:
                return self._typed(target)
        try:
            return value[part]
        except (KeyError, TypeError) as error:
            return self._refused(error.args[0])

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
        if kind == "fraction":
            return self._fraction(text)
        if kind == "number":
            return self._literal(text)
        if kind == "letter":
            return self._letter(text)
        if kind == "name":
            return self.named(text)
        raise ExpressionError(f"{self.text!r}: {text!r} is not expected there")

    def _fraction(self, text: str) -> Number:
        """Of the program's own `double`, if it has one: compilers may make it as short as a float."""
        kind = FLOAT if text[-1] in "fF" else self.inspector.debug.type("double") or FLOATING
        return Number(float(converted(float(text.rstrip("fFlL")), kind)), kind)

    def _literal(self, text: str) -> Number:
        digits = text.rstrip("uUlL")
        suffix = text[len(digits) :].lower()
        is_decimal = not digits.startswith("0")
        try:
            value = int(digits, 10 if is_decimal else 0 if digits[1:2].lower() in ("x", "b") else 8)
            return whole(
                value, unsigned="u" in suffix, size=(INT, 4, 8)[min(suffix.count("l"), 2)],
                may_be_unsigned=not is_decimal or value >= 1 << 63,
            )  # fmt: skip
        except ValueError:
            raise ExpressionError(f"{text[:40]!r} is no number of C, or too large for any type") from None

    def _letter(self, text: str) -> Number:
        if text[:1] != "\\":
            code = ord(text)
        elif text[1] in "x01234567":
            code = int(text[2:], 16) if text[1] == "x" else int(text[1:], 8)
        else:
            code = ESCAPES.get(text[1], -1)
        if not 0 <= code < 256:
            raise ExpressionError(f"{self.text!r}: '{text}' is no char")
        return Number(code - 256 if code >= 128 else code)

    def named(self, name: str) -> Any:
        inspector = self.inspector
        variable = inspector.variable(name, self.frame) if not name.startswith("$") else None
        if variable is not None:
            return inspector.value(variable, self.frame) if self.evaluates else self._typed(variable.type, name)
        bare = name.removeprefix("$")
        register = re.fullmatch(r"[Ww](\d|1[0-5])", bare)
        sfr = inspector.image.chip.sfrs.get(bare.removesuffix("bits"))
        symbol = inspector.symbol(name) if not name.startswith("$") and not register and sfr is None else None
        if symbol is not None:
            return symbol
        if name in inspector.debug.constants:
            return whole(inspector.debug.constants[name], may_be_unsigned=True)
        if register is not None:
            return Value(UNSIGNED[2], (Piece("register", int(register[1])),), inspector.view(self.frame), bare)
        if sfr is not None:
            place = (Piece("memory", sfr.address),)
            return Value(UNSIGNED[sfr.size], place, inspector.view(self.frame), bare.removesuffix("bits"))
        if bare.lower() == "pc":
            return Number(self.frame.pc if self.frame is not None else inspector.machine.pc, UNSIGNED[4])
        if bare == "cycle":
            return Number(inspector.machine.cycle, UNSIGNED[8])
        function = inspector.image.symbols.find(name)
        if function is not None:
            return Number(function.address, UNSIGNED[4])
        if self.forgives:
            return NOTHING
        raise ExpressionError(f"there is nothing called {name!r} here")


def _points(value: Any) -> bool:
    return isinstance(value, Value) and value.type.bare.kind == "pointer"


def _constant(kind: Type, number: int | float, inspector: Inspector) -> Value:
    """A value that has no place."""
    return Value(kind, (Piece("value", 0, data=encode(kind, number)),), inspector.view())
