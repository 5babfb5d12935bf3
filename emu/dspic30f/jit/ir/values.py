"""Values in generated code: the operands of instruction rows during translation.

A `Value` is a 64-bit integer or a one-bit truth value in LLVM IR. Each operator emits one line of IR into the current
block. Python ints are constants. Rows treat both kinds equally.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal


class Block:
    """Basic block under construction: its label and its lines of IR."""

    __slots__ = ("ended", "label", "lines")

    def __init__(self, label: str) -> None:
        self.label: Final = label
        self.lines: Final[list[str]] = []
        self.ended = False


class Emitter:
    """Writes IR lines into the current block and generates names."""

    def __init__(self, last_name: int = 0) -> None:
        self.blocks: Final[list[Block]] = []
        self.block = Block("none")
        self.last_name = last_name

    def name(self) -> str:
        """Return a new SSA name."""
        self.last_name += 1
        return f"%v{self.last_name}"

    def start(self, label: str) -> Block:
        """Begin the block `label`; subsequent lines are written into it."""
        self.block = Block(label)
        self.blocks.append(self.block)
        return self.block

    def fresh(self, stem: str) -> str:
        """Return a new label that begins with `stem`."""
        self.last_name += 1
        return f"{stem}.{self.last_name}"

    def line(self, text: str) -> None:
        """Write a line of IR that has no result."""
        self.block.lines.append(text)

    def end(self, text: str) -> None:
        """Write the terminator of the current block."""
        self.block.lines.append(text)
        self.block.ended = True

    def let(self, text: str, bit: bool = False) -> Value:
        """Write a line with a result of 1 bit if `bit`, else of 64 bits. Return the result."""
        name = self.name()
        self.block.lines.append(f"{name} = {text}")
        return Value(self, name, bit)

    def select(self, c: Number, a: Number, b: Number) -> Number:
        """Emit a selection: `a` if `c` else `b`."""
        if isinstance(c, int):
            return a if c else b
        if isinstance(a, Value) and isinstance(b, Value) and a.bit and b.bit:
            return self.let(f"select i1 {truth(c)}, i1 {a.text}, i1 {b.text}", bit=True)
        return self.let(f"select i1 {truth(c)}, i64 {wide(a)}, i64 {wide(b)}")

    def load(self, pointer: str, bits: int) -> Value:
        """Emit a zero-extended load of 8, 16, 32 or 64 bits."""
        if bits == 64:
            return self.let(f"load i64, ptr {pointer}, align 1")
        raw = self.name()
        self.block.lines.append(f"{raw} = load i{bits}, ptr {pointer}, align 1")
        return self.let(f"zext i{bits} {raw} to i64")

    def store(self, pointer: str, value: Number, bits: int) -> None:
        """Emit a store of the low 8, 16, 32 or 64 bits."""
        text = wide(value)
        if bits == 64 or isinstance(value, int):
            constant = text if bits == 64 else str(int(text) & ((1 << bits) - 1))
            self.block.lines.append(f"store i{bits} {constant}, ptr {pointer}, align 1")
            return
        raw = self.name()
        self.block.lines.append(f"{raw} = trunc i64 {text} to i{bits}")
        self.block.lines.append(f"store i{bits} {raw}, ptr {pointer}, align 1")

    def text(self) -> str:
        """Return the IR of all blocks in order."""
        parts: list[str] = []
        for block in self.blocks:
            parts.append(block.label + ":")
            parts.extend(block.lines)
        return "\n".join(parts)


@dataclass(frozen=True, slots=True)
class Origin:
    """Origin of a truth value.

    It is true if `word` is zero ("zero"), has bit `bit` set ("bit"), or is not zero after a shift right by `bit`
    ("above").
    """

    kind: Literal["zero", "bit", "above"]
    word: Value
    bit: int


class Value:
    """Value that is known only at run time. `origin` describes how its truth follows from a word, None if unknown."""

    __slots__ = ("bit", "emitter", "origin", "text")

    def __init__(self, emitter: Emitter, text: str, bit: bool, origin: Origin | None = None) -> None:
        self.emitter: Final = emitter
        self.text: Final = text
        self.bit: Final = bit
        self.origin: Final = origin

    def _with_origin(self, kind: Literal["zero", "bit", "above"], word: Value, bit: int) -> Value:
        return self if word.bit else Value(self.emitter, self.text, self.bit, Origin(kind, word, bit))

    def _op(self, op: str, left: Number, right: Number) -> Value:
        if (
            isinstance(left, Value)
            and isinstance(right, Value)
            and left.bit
            and right.bit
            and op in ("and", "or", "xor")
        ):
            return self.emitter.let(f"{op} i1 {left.text}, {right.text}", bit=True)
        return self.emitter.let(f"{op} i64 {wide(left)}, {wide(right)}")

    def _compare(self, predicate: str, other: Number) -> Value:
        return self.emitter.let(f"icmp {predicate} i64 {wide(self)}, {wide(other)}", bit=True)

    def __add__(self, other: Number) -> Value:
        return self._op("add", self, other)

    def __radd__(self, other: int) -> Value:
        return self._op("add", other, self)

    def __sub__(self, other: Number) -> Value:
        return self._op("sub", self, other)

    def __rsub__(self, other: int) -> Value:
        return self._op("sub", other, self)

    def __mul__(self, other: Number) -> Value:
        return self._op("mul", self, other)

    def __rmul__(self, other: int) -> Value:
        return self._op("mul", other, self)

    def __and__(self, other: Number) -> Value:
        made, shifted = self._op("and", self, other), self.origin
        if isinstance(other, int) and other == 1 and shifted is not None and shifted.kind == "above":
            return made._with_origin("bit", shifted.word, shifted.bit)
        return made

    def __rand__(self, other: int) -> Value:
        return self._op("and", other, self)

    def __or__(self, other: Number) -> Value:
        return self._op("or", self, other)

    def __ror__(self, other: int) -> Value:
        return self._op("or", other, self)

    def __xor__(self, other: Number) -> Value:
        return self._op("xor", self, other)

    def __rxor__(self, other: int) -> Value:
        return self._op("xor", other, self)

    def __lshift__(self, other: Number) -> Value:
        return self._op("shl", self, other)

    def __rlshift__(self, other: int) -> Value:
        return self._op("shl", other, self)

    def __rshift__(self, other: Number) -> Value:
        made = self._op("ashr", self, other)
        return made._with_origin("above", self, other) if isinstance(other, int) else made

    def __rrshift__(self, other: int) -> Value:
        return self._op("ashr", other, self)

    def __neg__(self) -> Value:
        return self._op("sub", 0, self)

    def __invert__(self) -> Value:
        return self._op("xor", self, -1)

    def __lt__(self, other: Number) -> Value:
        return self._compare("slt", other)

    def __le__(self, other: Number) -> Value:
        return self._compare("sle", other)

    def __gt__(self, other: Number) -> Value:
        return self._compare("sgt", other)

    def __ge__(self, other: Number) -> Value:
        return self._compare("sge", other)

    def __eq__(self, other: object) -> Value:  # type: ignore[override]
        assert isinstance(other, (int, Value))
        made = self._compare("eq", other)
        return made._with_origin("zero", self, 0) if isinstance(other, int) and other == 0 else made

    def __ne__(self, other: object) -> Value:  # type: ignore[override]
        assert isinstance(other, (int, Value))
        return self._compare("ne", other)

    def __bool__(self) -> bool:
        raise TypeError("a row asked for the truth of a value that is only known when its code runs; use m.select")

    __hash__ = None  # type: ignore[assignment]


Number = int | Value


def wide(value: Number) -> str:
    """Return a value as IR operand of type i64."""
    if isinstance(value, int):
        return str(int(value))
    if value.bit:
        return value.emitter.let(f"zext i1 {value.text} to i64").text
    return value.text


def truth(value: Number) -> str:
    """Return the truth of a value (value != 0) as IR operand of type i1."""

    if isinstance(value, int):
        return "true" if value else "false"
    if value.bit:
        return value.text
    return value.emitter.let(f"icmp ne i64 {value.text}, 0", bit=True).text
