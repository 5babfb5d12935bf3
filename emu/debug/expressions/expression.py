"""C expressions on a paused machine: `robot.speed[1]`, `*p`, `list->pid == 3`, `U1STA.TRMT`, `W3 + 2`.

Inputs: a text and the frame in which it is evaluated. Output: a `Value` if the text denotes an object, else a number.
Evaluation changes nothing. Names are looked up in this order: locals, statics of the file, globals, symbols without
type, enumerators, registers (SFRs and their fields, `W0` to `W15`, `PC`), and `cycle`. Arithmetic is that of C
(`arithmetic.py`): `now - then` of two unsigned ints is unsigned, and pointers count in units of their target. Casts and
`sizeof` accept the type names of the program and of C (`type_names.py`).
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
    TypedNumber,
    apply_binary,
    common_type,
    complement,
    convert,
    integer_constant,
    negate,
    promote,
)
from emu.debug.expressions.type_names import TypeNameError, type_name
from emu.debug.frame import Frame
from emu.debug.inspector import Inspector
from emu.debug.value import Value

TOKEN: Final = re.compile(
    r"\s*(?:((?:\d+\.\d*|\.\d+)(?:[eE][-+]?\d+)?[fFlL]?|\d+[eE][-+]?\d+[fFlL]?)|((?:0[xX][0-9a-fA-F]+|0[bB][01]+|\d+)[uUlL]*)"
    r"|'(\\x[0-9a-fA-F]+|\\[0-7]{1,3}|\\.|[^'\\])'|(\$?[A-Za-z_]\w*)"
    r"|(->|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^~!<>()\[\].?:]))"
)
TOKEN_KINDS: Final = ("fraction", "number", "letter", "name", "sign")
"""Names of the groups of the regular expression TOKEN."""
MAX_NESTING: Final = 50
"""Maximum nesting depth of parentheses, brackets, unary operators and conditional operators."""
ESCAPES: Final = dict(zip("abfnrtv\\'\"?", (7, 8, 12, 10, 13, 9, 11, 92, 39, 34, 63), strict=True))


UNEVALUATED: Final = TypedNumber(0)
"""Placeholder result of an expression that is not evaluated."""


class ExpressionError(ValueError):
    """The text is not a valid expression, or has no value in this state."""


@lru_cache(maxsize=512)
def tokens(text: str) -> tuple[tuple[str, str], ...]:
    """Return all tokens as (kind, text). Raises ExpressionError."""
    found, place = [], 0
    while text[place:].strip():
        match = TOKEN.match(text, place)
        if match is None:
            raise ExpressionError(f"{text!r}: {text[place:].strip()!r} is not understood")
        kind = TOKEN_KINDS[(match.lastindex or 1) - 1]
        found.append((kind, match[match.lastindex or 1]))
        place = match.end()
    if not found:
        raise ExpressionError("an empty expression")
    return tuple(found)


def evaluate(inspector: Inspector, text: str, frame: Frame | None = None) -> Value | int | float:
    """Return the object or the number that `text` denotes in `frame`. Raises ExpressionError, Unavailable."""
    parser = _Parser(inspector, text, frame)
    result = parser.expression(0)
    if parser.at < len(parser.tokens):
        raise ExpressionError(f"{text!r}: {parser.tokens[parser.at][1]!r} is too much")
    found: Value | int | float = result.value if isinstance(result, TypedNumber) else result
    return found


def number_of(result: Value | int | float) -> Any:
    """Return a result of `evaluate` as a Python number or other object. Raises Unavailable."""
    return result.get() if isinstance(result, Value) else result


class _Parser:
    """Precedence-climbing parser that evaluates while it parses, apart from the operands that C does not evaluate."""

    def __init__(self, inspector: Inspector, text: str, frame: Frame | None) -> None:
        self.inspector: Final = inspector
        self.text: Final = text
        self.frame: Final = frame
        self.tokens: Final = tokens(text)
        self.at = self.depth = 0
        self.evaluates = True
        """False inside an unevaluated operand. Expressions there have a type but no value, and the machine is not
        read."""
        self.is_lenient = False
        """Whether errors yield 0. An operand that C does not evaluate may name an object that does not exist."""

    def _peek(self) -> str:
        return self.tokens[self.at][1] if self.at < len(self.tokens) and self.tokens[self.at][0] == "sign" else ""

    def _accept(self, sign: str) -> bool:
        if self._peek() == sign:
            self.at += 1
            return True
        return False

    def _expect(self, sign: str) -> None:
        if not self._accept(sign):
            raise ExpressionError(f"{self.text!r}: expected {sign!r}")

    def expression(self, lowest: int) -> Any:
        left = self.unary()
        while (sign := self._peek()) in BINARY and BINARY[sign][0] > lowest:
            self.at += 1
            decides = {"||": True, "&&": False}.get(sign)
            right = self._short_circuit(
                decides is not None and bool(self._number(left).value) == decides, BINARY[sign][0]
            )
            left = self._binary(sign, left, right)
        if not lowest and self._accept("?"):
            with self._nested():
                holds = bool(self._number(left).value)
                yes = self._short_circuit(not holds, 0)
                self._expect(":")
                no = self._short_circuit(holds, 0)
                return self._conditional_result(yes, no) if holds else self._conditional_result(no, yes)
        return left

    def _conditional_result(self, taken: Any, other: Any) -> Any:
        """Return the selected operand of a conditional operator, converted to the common type of both (C11 §6.5.15)."""
        if not (self._is_arithmetic(taken) and self._is_arithmetic(other)):
            return taken
        if isinstance(taken, Value) and isinstance(other, Value) and taken.type is other.type:
            return taken
        number = self._number(taken)
        with self._unevaluated():
            kind = common_type(number.kind, self._number(other).kind)
        return TypedNumber(convert(number.value, kind), kind)

    def _is_arithmetic(self, value: Any) -> bool:
        return isinstance(value, TypedNumber) or (value.type.is_number and not _is_pointer(value))

    @contextmanager
    def _nested(self) -> Iterator[None]:
        """Enter one more nesting level inside the block. Raises ExpressionError beyond MAX_NESTING."""
        self.depth += 1
        if self.depth > MAX_NESTING:
            raise ExpressionError(f"more than {MAX_NESTING} brackets or signs inside one another")
        try:
            yield
        finally:
            self.depth -= 1

    @contextmanager
    def _unevaluated(self, is_lenient: bool | None = None) -> Iterator[None]:
        """Parse without evaluating inside the block."""
        before = self.evaluates, self.is_lenient
        self.evaluates, self.is_lenient = False, self.is_lenient if is_lenient is None else is_lenient
        try:
            yield
        finally:
            self.evaluates, self.is_lenient = before

    def _short_circuit(self, decided: bool, lowest: int) -> Any:
        """Parse an operand of && or ||; do not evaluate it if the result is already `decided`."""
        if not decided:
            return self.expression(lowest)
        with self._unevaluated(is_lenient=True):
            return self.expression(lowest)

    def _error(self, why: object) -> TypedNumber:
        """Raise ExpressionError. Return 0 instead where errors are permitted."""
        if self.is_lenient:
            return UNEVALUATED
        raise ExpressionError(f"{self.text!r}: {why}")

    def _read(self, value: Value) -> Any:
        """Return the value of an object. In an unevaluated operand return 1, because every operator accepts it."""
        return value.get() if self.evaluates else 1.0 if value.type.bare.kind == "float" else 1

    def _placeholder(self, kind: Type, name: str = "", bits: tuple[int, int] | None = None) -> Value:
        """Return an object of type `kind` without a location, for unevaluated operands."""
        return Value(kind, (Piece("gone", 0),), self.inspector.view(self.frame), name, bits)

    def _binary(self, sign: str, left: Any, right: Any) -> Any:
        one, other = self._decay(left), self._decay(right)
        if sign == "+" and _is_pointer(other) and not _is_pointer(one):
            one, other = other, one
        try:
            if sign in ("+", "-") and _is_pointer(one):
                step = max(one.type.bare.target.bytes, 1) if one.type.bare.target is not None else 1
                if not _is_pointer(other):
                    distance = self._integer(sign, self._number(other)) * step
                    address = self._read(one) + (distance if sign == "+" else -distance)
                    return _constant(one.type, address & 0xFFFF, self.inspector)
                if sign == "-":
                    return apply_binary("/", TypedNumber(self._read(one) - self._read(other)), TypedNumber(step))
            return apply_binary(sign, self._number(one), self._number(other))
        except (ArithmeticError, TypeError, ValueError) as error:
            return self._error(error)

    def _decay(self, value: Any) -> Any:
        """Convert an array to a pointer to its first element."""
        if isinstance(value, Value) and value.type.bare.kind == "array":
            pointer = Type("pointer", size=2, target=value.type.bare.target)
            if not self.evaluates:
                return self._placeholder(pointer)
            if value.address is not None:
                return _constant(pointer, value.address, self.inspector)
        return value

    def _number(self, value: Any) -> TypedNumber:
        value = self._decay(value)
        if isinstance(value, Value):
            if not value.type.is_number:
                return self._error(f"a {value.type} is no number")
            return promote(self._read(value), value.type, value.bits[0] if value.bits is not None else 0)
        assert isinstance(value, TypedNumber)
        return value if self.evaluates else TypedNumber(type(value.value)(1), value.kind)

    def _integer(self, sign: str, number: TypedNumber) -> int:
        if not isinstance(number.value, int):
            return int(self._error(f"{sign} needs whole numbers").value)
        return number.value

    def unary(self) -> Any:
        with self._nested():
            return self._unary_operator()

    def _unary_operator(self) -> Any:
        if (kind := self._parenthesised_type()) is not None:
            return self._cast(kind, self.unary())
        if self.at < len(self.tokens) and self.tokens[self.at] == ("name", "sizeof"):
            self.at += 1
            return self._sizeof()
        if self._accept("-"):
            return negate(self._number(self.unary()))
        if self._accept("+"):
            return self._number(self.unary())
        if self._accept("~"):
            number = self._number(self.unary())
            return complement(number) if number.is_integer else self._error("~ needs whole numbers")
        if self._accept("!"):
            return TypedNumber(int(not self._number(self.unary()).value))
        if self._accept("*"):
            return self._part(self.unary(), 0)
        if self._accept("&"):
            return self._address(self.unary())
        return self.postfix()

    def _parenthesised_type(self) -> Type | None:
        """Parse a type name in parentheses. Return its type, None if the next tokens are not a type name."""
        if self._peek() != "(":
            return None
        try:
            found = type_name(self.tokens, self.at + 1, self._find_type)
        except TypeNameError as error:
            raise ExpressionError(f"{self.text!r}: {error}") from None
        if found is None:
            return None
        self.at = found[1]
        self._expect(")")
        return found[0]

    def _find_type(self, name: str) -> Type | None:
        """Return the program's type called `name`, None if `name` is a variable or unknown."""
        unit = self.frame.scopes[0].unit if self.frame is not None and self.frame.scopes else -1
        return None if self.inspector.variable(name, self.frame) is not None else self.inspector.debug.type(name, unit)

    def _sizeof(self) -> TypedNumber:
        """Return the size of the operand of `sizeof`, which is not evaluated."""
        kind = self._parenthesised_type()
        if kind is None:
            with self._unevaluated():
                value = self.unary()
            if isinstance(value, Value) and value.bits is not None:
                return self._error("a bit field has no size")
            kind = value.kind if isinstance(value, TypedNumber) else value.type
        if not kind.bytes:
            return self._error(f"the size of {kind} is not known")
        return integer_constant(kind.bytes, unsigned=True)

    def _cast(self, kind: Type, value: Any) -> Any:
        one = self._decay(value)
        if isinstance(one, Value) and one.type.bare is kind.bare:
            return one
        if not kind.is_number or (isinstance(one, Value) and not one.type.is_number):
            return self._error(f"what is {one.type if isinstance(one, Value) else 'a number'} is no {kind}")
        try:
            number = self._read(one) if isinstance(one, Value) else one.value
            return _constant(kind, convert(number, kind), self.inspector)
        except ValueError as error:
            return self._error(error)

    def _address(self, value: Any) -> Value | TypedNumber:
        if isinstance(value, Value) and value.bits is None and not self.evaluates:
            return self._placeholder(Type("pointer", size=2, target=value.type))
        if not isinstance(value, Value) or value.address is None or value.bits is not None:
            return self._error("that has no address")
        return _constant(Type("pointer", size=2, target=value.type), value.address, self.inspector)

    def postfix(self) -> Any:
        value = self.primary()
        while True:
            if self._accept("["):
                index = self.expression(0)
                self._expect("]")
                if isinstance(value, TypedNumber) and _is_pointer(self._decay(index)):
                    value, index = index, value
                value = self._part(value, self._integer("[]", self._number(index)))
            elif self._accept("->"):
                value = self._part(self._part(value, 0), self._name())
            elif self._accept("."):
                value = self._part(value, self._name())
            else:
                return value

    def _part(self, value: Any, part: str | int) -> Value | TypedNumber:
        if isinstance(value, TypedNumber) and isinstance(value.value, int) and part == 0:
            return Value(UNSIGNED[2], (Piece("memory", value.value & 0xFFFF),), self.inspector.view(self.frame), "")
        if not isinstance(value, Value):
            return self._error("a number has no parts")
        sfr = self.inspector.image.chip.sfrs.get(value.name) if isinstance(part, str) else None
        if sfr is not None and part in sfr.fields:
            lsb, width = sfr.fields[str(part)]
            return Value(value.type, value.pieces, self.inspector.view(self.frame), str(part), (width, lsb))
        if not isinstance(part, str) and (target := value.type.bare.target) is not None:
            if target.bare.kind in ("void", "function"):
                return self._error(f"what a {value.type} points to has no value")
            if not self.evaluates:
                return self._placeholder(target)
        try:
            return value[part]
        except (KeyError, TypeError) as error:
            return self._error(error.args[0])

    def _name(self) -> str:
        if self.at < len(self.tokens) and self.tokens[self.at][0] == "name":
            self.at += 1
            return self.tokens[self.at - 1][1]
        raise ExpressionError(f"{self.text!r}: expected a name")

    def primary(self) -> Any:
        if self._accept("("):
            value = self.expression(0)
            self._expect(")")
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
            return self.identifier(text)
        raise ExpressionError(f"{self.text!r}: {text!r} is not expected there")

    def _fraction(self, text: str) -> TypedNumber:
        """Return a floating-point constant as the program's `double`, which some compilers make a `float`."""
        kind = FLOAT if text[-1] in "fF" else self.inspector.debug.type("double") or FLOATING
        return TypedNumber(float(convert(float(text.rstrip("fFlL")), kind)), kind)

    def _literal(self, text: str) -> TypedNumber:
        digits = text.rstrip("uUlL")
        suffix = text[len(digits) :].lower()
        is_decimal = not digits.startswith("0")
        try:
            value = int(digits, 10 if is_decimal else 0 if digits[1:2].lower() in ("x", "b") else 8)
            return integer_constant(
                value, unsigned="u" in suffix, size=(INT, 4, 8)[min(suffix.count("l"), 2)],
                may_be_unsigned=not is_decimal or value >= 1 << 63,
            )  # fmt: skip
        except ValueError:
            raise ExpressionError(f"{text[:40]!r} is no number of C, or too large for any type") from None

    def _letter(self, text: str) -> TypedNumber:
        if text[:1] != "\\":
            code = ord(text)
        elif text[1] in "x01234567":
            code = int(text[2:], 16) if text[1] == "x" else int(text[1:], 8)
        else:
            code = ESCAPES.get(text[1], -1)
        if not 0 <= code < 256:
            raise ExpressionError(f"{self.text!r}: '{text}' is no char")
        return TypedNumber(code - 256 if code >= 128 else code)

    def _is_register(self, name: str) -> bool:
        return name.upper() in self.inspector.processor.register_names

    def identifier(self, name: str) -> Any:
        inspector = self.inspector
        variable = inspector.variable(name, self.frame) if not name.startswith("$") else None
        if variable is not None:
            return inspector.value(variable, self.frame) if self.evaluates else self._placeholder(variable.type, name)
        bare = name.removeprefix("$")
        register = inspector.processor.register_names.index(bare.upper()) if self._is_register(bare) else None
        sfr = inspector.image.chip.sfrs.get(bare.removesuffix("bits"))
        symbol = inspector.symbol(name) if not name.startswith("$") and register is None and sfr is None else None
        if symbol is not None:
            return symbol
        if name in inspector.debug.constants:
            return integer_constant(inspector.debug.constants[name], may_be_unsigned=True)
        if register is not None:
            size = inspector.processor.register_size(register)
            return Value(UNSIGNED[size], (Piece("register", register),), inspector.view(self.frame), bare)
        if sfr is not None:
            place = (Piece("memory", sfr.address),)
            return Value(UNSIGNED[sfr.size], place, inspector.view(self.frame), bare.removesuffix("bits"))
        if bare.lower() == "pc":
            return TypedNumber(self.frame.pc if self.frame is not None else inspector.machine.pc, UNSIGNED[4])
        if bare == "cycle":
            return TypedNumber(inspector.machine.cycle, UNSIGNED[8])
        function = inspector.image.symbols.find(name)
        if function is not None:
            return TypedNumber(function.address, UNSIGNED[4])
        if self.is_lenient:
            return UNEVALUATED
        raise ExpressionError(f"there is nothing called {name!r} here")


def _is_pointer(value: Any) -> bool:
    return isinstance(value, Value) and value.type.bare.kind == "pointer"


def _constant(kind: Type, number: int | float, inspector: Inspector) -> Value:
    """Return a constant as a value without a location."""
    return Value(kind, (Piece("value", 0, data=encode(kind, number)),), inspector.view())
