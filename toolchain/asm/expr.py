"""Assembler expressions: parsing of text to a tree, and evaluation of the tree to a value of `symbols`.

Operators and precedence are those of GNU as 2.14, on which pic30-as is based (abi-elf.md §4): `* / % << >>` bind
tightest, then `| & ^ !` (or-not), then `+ -`, then comparisons (true is -1), then `&&`, then `||`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from toolchain.asm.symbols import AsmSymbol, ExprValue, Label, PendingOperation, SymbolValue

MASK64 = 0xFFFF_FFFF_FFFF_FFFF
MAX_DEPTH = 64  # maximum nesting of parentheses and prefixes; deeper input is an error instead of a stack overflow
OPERATORS = frozenset(
    ["tbloffset", "tblpage", "psvoffset", "psvpage", "handle", "paddr", "edspage", "edsoffset", "addr_lo", "addr_hi"]
)
"""Operators of expressions (abi-elf.md §4.2); `_REFUSED` has those of other chips."""
_REFUSED = {
    "lo": "lo() is not an operator of this assembler: use & 0xFFFF",
    "hi": "hi() is not an operator of this assembler: use >> 16",
    "dmaoffset": "dmaoffset() needs a part with DMA",
    "dmapage": "dmapage() needs a part with DMA",
    "boot": "boot() CodeGuard access slots are not supported",
    "secure": "secure() CodeGuard access slots are not supported",
    "packed_lo": "packed_lo() needs a part with packed flash",
    "packed_hi": "packed_hi() needs a part with packed flash",
}


class ExprError(Exception):
    """An expression that cannot be parsed or has no value; the caller adds file and line."""


@dataclass(frozen=True, slots=True)
class Name:
    """A symbol; numeric local labels keep their spelling (`1f`)."""

    text: str


@dataclass(frozen=True, slots=True)
class Here:
    """Expression `.` or `$`: the current location."""


@dataclass(frozen=True, slots=True)
class Unary:
    op: str
    operand: Tree


@dataclass(frozen=True, slots=True)
class Binary:
    op: str
    left: Tree
    right: Tree


@dataclass(frozen=True, slots=True)
class Apply:
    """Application of an operator such as `tbloffset(x)`."""

    op: str
    operand: Tree


Tree = int | Name | Here | Unary | Binary | Apply


_TOKEN = re.compile(
    r"""\s*(?:
    (?P<num>0[xX][0-9a-fA-F]+|0[bB][01]+|\d+[fb](?![\w.$])|\d+)
  | (?P<limit>\.(?:startof|sizeof|endof)\.\s*\(\s*(?P<sec>[^\s()]+)\s*\))
  | (?P<name>[A-Za-z_.$][\w.$]*)
  | (?P<char>'(?P<inside>\\[0-7]{1,3}|\\x[0-9a-fA-F]{1,2}|\\.|[^\\])'?)
  | (?P<op><<|>>|<=|>=|==|!=|<>|&&|\|\||[-+*/%|&^!~<>()])
  )""",
    re.VERBOSE,
)
_RANK = {
    **dict.fromkeys(("*", "/", "%", "<<", ">>"), 6),
    **dict.fromkeys(("|", "&", "^", "!"), 5),
    **dict.fromkeys(("+", "-"), 4),
    **dict.fromkeys(("==", "!=", "<>", "<", ">", "<=", ">="), 3),
    "&&": 2,
    "||": 1,
}
_ESCAPES = {"b": 8, "f": 12, "n": 10, "r": 13, "t": 9, "v": 11, "a": 7}


def unescape(text: str) -> bytes:
    """Return the bytes of a quoted string's inside; octal and \\x escapes are read as GNU as does."""
    out = bytearray()
    for match in re.finditer(r"\\([0-7]{1,3})|\\[xX]([0-9a-fA-F]+)|\\(.)|([^\\])", text, re.DOTALL):
        octal, hexadecimal, other, plain = match.groups()
        if octal:
            out.append(int(octal, 8) & 0xFF)
        elif hexadecimal:
            out.append(int(hexadecimal, 16) & 0xFF)
        elif other:
            out += bytes((_ESCAPES[other],)) if other in _ESCAPES else other.encode("utf-8")
        else:
            out += plain.encode("utf-8")
    return bytes(out)


def _number(text: str) -> int:
    if text[:2] in ("0x", "0X"):
        return int(text, 16)
    if text[:2] in ("0b", "0B"):
        return int(text, 2)
    if text[0] == "0" and len(text) > 1:
        if not text.isdigit() or "8" in text or "9" in text:
            raise ExprError(f"bad octal number {text}")
        return int(text, 8)
    return int(text)


class _Parser:
    """Parser of one expression by precedence climbing over its tokens."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.tokens: list[tuple[str, str]] = []
        position = 0
        text = text.rstrip()
        while position < len(text):
            match = _TOKEN.match(text, position)
            if match is None:
                raise ExprError(f"cannot read {text[position:].strip()!r} in expression {text.strip()!r}")
            if match["char"] is not None:
                self.tokens.append(("char", match["inside"]))
            else:
                kind = "limit" if match["limit"] is not None else str(match.lastgroup)
                self.tokens.append((kind, match.group().strip()))
            position = match.end()
        self.next = 0
        self.depth = 0

    def peek(self) -> str:
        return self.tokens[self.next][1] if self.next < len(self.tokens) else ""

    def take(self) -> tuple[str, str]:
        if self.next >= len(self.tokens):
            whole = self.text.strip()
            raise ExprError(f"expression {whole!r} ends too early" if whole else "missing expression")
        self.next += 1
        return self.tokens[self.next - 1]

    def expect(self, op: str) -> None:
        if self.peek() != op:
            raise ExprError(f"expected {op!r} in expression {self.text.strip()!r}")
        self.next += 1

    def binary(self, lowest: int) -> Tree:
        left = self.prefix()
        while True:
            op = self.peek()
            rank = _RANK.get(op, 0)
            if rank < lowest or self.tokens[self.next][0] != "op":
                return left
            self.next += 1
            left = Binary("!=" if op == "<>" else op, left, self.binary(rank + 1))

    def prefix(self) -> Tree:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise ExprError(f"expression nested deeper than {MAX_DEPTH}")
        kind, text = self.take()
        tree = self._atom(kind, text)
        self.depth -= 1
        return tree

    def _atom(self, kind: str, text: str) -> Tree:
        if kind == "num":
            return Name(text) if text[-1] in "fb" and text[:-1].isdigit() else _number(text)
        if kind == "char":
            return unescape(text)[0]
        if kind == "limit":
            return Name(re.sub(r"\s", "", text).replace("(", "").replace(")", ""))
        if kind == "name":
            return self._name(text)
        if text == "(":
            tree = self.binary(1)
            self.expect(")")
            return tree
        if text in ("-", "+", "~", "!"):
            operand = self.prefix()
            if text == "+":
                return operand
            return -operand if text == "-" and isinstance(operand, int) else Unary(text, operand)
        raise ExprError(f"unexpected {text!r} in expression {self.text.strip()!r}")

    def _name(self, text: str) -> Tree:
        if text in (".", "$"):
            return Here()
        if self.peek() != "(":
            return Name(text)
        if text.lower() in _REFUSED:
            raise ExprError(_REFUSED[text.lower()])
        if text.lower() not in OPERATORS:
            raise ExprError(f"unknown operator {text}()")
        self.next += 1
        tree = self.binary(1)
        self.expect(")")
        return Apply(text.lower(), tree)


@lru_cache(maxsize=16384)
def parse(text: str) -> Tree:
    """Return the tree of `text`; raise `ExprError` if `text` is no expression."""
    parser = _Parser(text)
    tree = parser.binary(1)
    if parser.next < len(parser.tokens):
        raise ExprError(f"unexpected {parser.peek()!r} in expression {text.strip()!r}")
    return tree


def wrap(value: int) -> int:
    """Return `value` as a signed 64-bit number, the width GNU as computes with."""
    value &= MASK64
    return value - (1 << 64) if value >> 63 else value


def _divide(a: int, b: int) -> int:
    quotient = abs(a) // abs(b)
    return quotient if (a < 0) == (b < 0) else -quotient


def _checked(fn: Callable[[int, int], int]) -> Callable[[int, int], int]:
    def divide(a: int, b: int) -> int:
        if b == 0:
            raise ExprError("division by zero")
        return fn(a, b)

    return divide


def _shift(a: int, b: int) -> int:
    if not 0 <= b < 64:
        raise ExprError(f"shift by {b} is outside 0..63")
    return a << b


_BINARY: dict[str, Callable[[int, int], int]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": _checked(_divide),
    "%": _checked(lambda a, b: a - b * _divide(a, b)),
    "<<": _shift,
    ">>": lambda a, b: a >> b if 0 <= b < 64 else _shift(a, b),
    "|": lambda a, b: a | b,
    "&": lambda a, b: a & b,
    "^": lambda a, b: a ^ b,
    "!": lambda a, b: a | ~b,
    "==": lambda a, b: -(a == b),
    "!=": lambda a, b: -(a != b),
    "<": lambda a, b: -(a < b),
    ">": lambda a, b: -(a > b),
    "<=": lambda a, b: -(a <= b),
    ">=": lambda a, b: -(a >= b),
    "&&": lambda a, b: int(bool(a and b)),
    "||": lambda a, b: int(bool(a or b)),
}
_UNARY: dict[str, Callable[[int], int]] = {"-": lambda a: -a, "~": lambda a: ~a, "!": lambda a: int(not a)}

CONSTANT_OPERATORS: dict[str, Callable[[int], int]] = {
    "tbloffset": lambda v: v & 0xFFFF,
    "tblpage": lambda v: v >> 16 & 0xFF,
    "psvoffset": lambda v: v & 0xFFFF | 0x8000,
    "psvpage": lambda v: v >> 15 & 0x1FF,
    "paddr": lambda v: v & 0xFFFFFF,
    "addr_lo": lambda v: v & 0xFFFF,
    "addr_hi": lambda v: v >> 16 & 0xFFFF,
}
"""Values of operators applied to plain numbers (abi-elf.md §4.2). handle() and eds*() of a plain number are errors."""


def distance(a: AsmSymbol, b: AsmSymbol, final: bool) -> int | None:
    """Return a - b in address units, None if unknown; between fragments it is known only when all sizes are `final`."""
    left, right = a.place, b.place
    if not isinstance(left, Label) or not isinstance(right, Label):
        return None
    if left.frag is right.frag:
        return left.offset - right.offset
    if final and left.frag.section is right.frag.section:
        return left.frag.start + left.offset - right.frag.start - right.offset
    return None


def combine(op: str, a: ExprValue, b: ExprValue, final: bool = False) -> ExprValue:
    """Return `a op b`, simplified as far as possible; raise `ExprError` if it can never have a value."""
    if isinstance(a, int) and isinstance(b, int):
        return wrap(_BINARY[op](a, b))
    if op in "+-":
        # This holds also for op(x)+n: the addend of a relocation is inside the operator.
        if isinstance(b, int) and isinstance(a, SymbolValue):
            return SymbolValue(a.add, a.sub, wrap(a.offset + b if op == "+" else a.offset - b), a.op)
        if op == "+" and isinstance(a, int) and isinstance(b, SymbolValue):
            return SymbolValue(b.add, b.sub, wrap(a + b.offset), b.op)
    if (
        isinstance(a, SymbolValue)
        and isinstance(b, SymbolValue)
        and op in _COMPARABLE
        and not (a.op or b.op or a.sub or b.sub)
    ):
        if a.add is b.add:
            return wrap(_BINARY[op](a.offset, b.offset))
        gap = distance(a.add, b.add, final) if a.add and b.add else None
        if gap is not None:
            return wrap(_BINARY[op](gap + a.offset, b.offset))
    return PendingOperation(op, a, b)


_COMPARABLE = frozenset(("-", "==", "!=", "<", ">", "<=", ">="))


def prefix(op: str, a: ExprValue) -> ExprValue:
    """Return `op a` for a prefix operator - ~ or !."""
    return wrap(_UNARY[op](a)) if isinstance(a, int) else PendingOperation("u" + op, a, None)


def apply(op: str, a: ExprValue) -> ExprValue:
    """Return op(a) for an operator such as tbloffset."""
    if isinstance(a, int):
        if op not in CONSTANT_OPERATORS:
            raise ExprError(f"{op}() needs a symbol, not a number")
        return CONSTANT_OPERATORS[op](a)
    if isinstance(a, SymbolValue):
        if a.op:
            raise ExprError(f"{op}() of {a.op}() has no meaning")
        return SymbolValue(a.add, a.sub, a.offset, op)
    return PendingOperation("f" + op, a, None)


def evaluate(tree: Tree, name: Callable[[str], ExprValue], here: Callable[[], ExprValue]) -> ExprValue:
    """Return the value of `tree`; `name` returns the value of a symbol, `here` that of the location counter."""
    if isinstance(tree, int):
        return tree
    if isinstance(tree, Name):
        return name(tree.text)
    if isinstance(tree, Here):
        return here()
    if isinstance(tree, Unary):
        return prefix(tree.op, evaluate(tree.operand, name, here))
    if isinstance(tree, Apply):
        return apply(tree.op, evaluate(tree.operand, name, here))
    return combine(tree.op, evaluate(tree.left, name, here), evaluate(tree.right, name, here))


def resolve(value: ExprValue, final: bool, seen: tuple[AsmSymbol, ...] = ()) -> ExprValue:
    """Return `value` with equated symbols replaced by their values and, if `final`, label distances by numbers."""
    if isinstance(value, int):
        return value
    if isinstance(value, PendingOperation):
        left = resolve(value.left, final, seen)
        if value.right is None:
            return prefix(value.op[1:], left) if value.op[0] == "u" else apply(value.op[1:], left)
        return combine(value.op, left, resolve(value.right, final, seen), final)
    result: ExprValue = 0
    if value.add is not None:
        result = _resolve_symbol(value.add, final, seen)
    if value.sub is not None:
        result = combine("-", result, _resolve_symbol(value.sub, final, seen), final)
    result = combine("+", result, value.offset, final)
    return apply(value.op, result) if value.op else result


def _resolve_symbol(symbol: AsmSymbol, final: bool, seen: tuple[AsmSymbol, ...]) -> ExprValue:
    if symbol in seen:
        raise ExprError(f"symbol {symbol.name} is defined in terms of itself")
    if symbol.place is None or isinstance(symbol.place, Label):
        return SymbolValue(symbol)
    return resolve(symbol.place, final, (*seen, symbol))
