"""Operand kinds: parsing, encoding and printing of each operand in a row's syntax.

A kind parses tokens of a statement to a ``Part`` (known fields and open slots), converts numbers to fields, and prints
fields in the spelling of binutils. It finds fields by letter, so one kind serves every row that has them.
"""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from .fields import Operands
from .flow import PC_MASK
from .row import Row

SymbolOf: TypeAlias = Callable[[int, str], str | None]  # address, "code" or "data" -> name


class OperandError(ValueError):
    """The operand has a valid form but a value that cannot be encoded."""


@dataclass(frozen=True, slots=True)
class Part:
    """Result of parsing tokens: known fields, and expressions that are still to be parsed.

    No expression is parsed before the whole statement matches a form, so that trying a form does not affect the caller.
    """

    taken: int
    fields: Mapping[str, int] = field(default_factory=dict)
    text: str | None = None  # expression for a number, which ``Kind.number`` converts to fields
    bit: str = ""  # expression for the bit number of an f-bit form


@dataclass(frozen=True, slots=True)
class Site:
    """Context that kinds need besides the row: the instruction's address and the access size of its mnemonic."""

    row: Row
    pc: int = 0
    byte: bool = False


REGISTER = re.compile(r"w(\d|1[0-5])", re.IGNORECASE)
INDIRECT = re.compile(r"\[\s*(\+\+|--)?\s*w(\d|1[0-5])\s*(\+\+|--)?\s*\]", re.IGNORECASE)
INDEXED = re.compile(r"\[\s*w(\d|1[0-5])\s*\+\s*w(\d|1[0-5])\s*\]", re.IGNORECASE)
OFFSET = re.compile(r"\[\s*w(\d|1[0-5])\s*([+-].*)\]", re.IGNORECASE | re.DOTALL)
MODES = {("", ""): 1, ("", "--"): 2, ("", "++"): 3, ("--", ""): 4, ("++", ""): 5}  # isa.md §3.1
MODE_TEXT = {mode: f"[{before}w{{}}{after}]" for (before, after), mode in MODES.items()}


def register_number(token: str) -> int | None:
    """Return the number 0..15 of a W register by its name, None for any other name."""
    match = REGISTER.fullmatch(token)
    return int(match[1]) if match else None


class Kind:
    """Parser and printer of one operand, or of an optional group of operands."""

    @abstractmethod
    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        """Consume tokens from the front. Return None if they do not have the form of the operand."""

    @abstractmethod
    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        """Return the operand as tokens of assembly text."""

    def number(self, value: int, at: Site) -> dict[str, int]:
        """Return the fields of a numeric operand.

        Raises OperandError if it is out of range, TypeError if the operand is not numeric.
        """
        raise TypeError(f"{type(self).__name__} is not a numeric operand")

    def relocation(self, at: Site) -> str:
        """Return the relocation type of a numeric operand that is a plain symbol; "" if only a number is permitted."""
        raise TypeError(f"{type(self).__name__} is not a numeric operand")


@dataclass(frozen=True)
class Fixed(Kind):
    """A fixed word: WREG, or a branch condition."""

    word: str

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        return Part(1) if tokens and tokens[0].upper() == self.word else None

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        return [self.word]


@dataclass(frozen=True)
class Register(Kind):
    """A W register. ``letters`` names its field, or its possible fields in order of preference."""

    letters: str

    def letter(self, row: Row) -> str:
        return next(letter for letter in self.letters if letter in row.fields)

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        n = register_number(tokens[0]) if tokens else None
        if n is None:
            return None
        fields = {self.letter(at.row): n}
        if {"t", "v"} <= at.row.fields.keys() and self.letters == "vt":
            fields["t"] = n + 1  # DIV.SD, DIV.UD name the low register
        return Part(1, fields)

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        return [f"w{getattr(x, self.letter(at.row))}"]


@dataclass(frozen=True)
class Address(Kind):
    """Ws or Wd in any mode of the row's mode field; also [Wn+Wb] in rows with eight modes."""

    register: str
    mode3: str
    mode8: str

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        if not tokens:
            return None
        mode = self.mode8 if self.mode8 in at.row.fields else self.mode3
        n = register_number(tokens[0])
        if n is not None:
            return Part(1, {self.register: n, mode: 0})
        if match := INDIRECT.fullmatch(tokens[0]):
            code = MODES.get((match[1] or "", match[3] or ""))
            return Part(1, {self.register: int(match[2]), mode: code}) if code else None
        if mode == self.mode8 and (match := INDEXED.fullmatch(tokens[0])):
            return Part(1, {self.register: int(match[1]), mode: 6, "w": int(match[2])})
        return None

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        n = getattr(x, self.register)
        mode = getattr(x, self.mode8 if self.mode8 in at.row.fields else self.mode3)
        if mode == 0:
            return [f"w{n}"]
        return [MODE_TEXT[mode].format(n) if mode in MODE_TEXT else f"[w{n}+w{x.w}]"]


@dataclass(frozen=True)
class OffsetAddress(Kind):
    """[Wn+lit]. The offset is in bytes in the text and in elements in the field."""

    register: str

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        match = OFFSET.fullmatch(tokens[0]) if tokens else None
        if match is None or INDIRECT.fullmatch(tokens[0]) or INDEXED.fullmatch(tokens[0]):
            return None
        return Part(1, {self.register: int(match[1])}, match[2].strip())

    def number(self, value: int, at: Site) -> dict[str, int]:
        size = 1 if at.byte else 2
        low, high = -512 * size, 511 * size
        if not low <= value <= high or value % size:
            raise OperandError(f"offset {value} is not in {low}..{high}" + (", even" if size == 2 else ""))
        return {"o": value // size}

    def relocation(self, at: Site) -> str:
        return ""

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        return [f"[w{getattr(x, self.register)}{x.o * (1 if x.B else 2):+d}]"]


# Relocation by width of field k (abi-elf.md §5); the assembler selects the variants for tbloffset() and the like.
LITERAL_RELOCATION = {
    16: "WORD",
    14: "UNSIGNED_14",
    13: "FRAME_SIZE",
    6: "DSP_6",
    5: "UNSIGNED_5",
    4: "UNSIGNED_4",
    1: "PWRSAV_MODE",
}


@dataclass(frozen=True)
class Literal(Kind):
    """#lit in field ``letter``, ``low``..``high``.

    Byte literals are -128 to 255; 10-bit ones depend on the access size.
    """

    letter: str
    low: int
    high: int
    byte: bool = False

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        if not tokens or not tokens[0].startswith("#"):
            return None
        return Part(1, text=tokens[0][1:].strip())

    def number(self, value: int, at: Site) -> dict[str, int]:
        field = at.row.fields[self.letter]
        byte = self.byte or (at.byte and self.high == 1023)
        low, high = (-128, 255) if byte else (self.low, self.high - self.high % field.scale)
        if not low <= value <= high or value % field.scale:
            raise OperandError(f"#{value} is not in {low}..{high}" + (", even" if field.scale == 2 else ""))
        if value < 0 and not field.signed:
            value &= 0xFF if byte else (1 << field.width) - 1
        return {self.letter: value}

    def relocation(self, at: Site) -> str:
        if self.byte or (at.byte and self.high == 1023):
            return "SIGNED_10_BYTE"
        if self.letter == "r":
            return "DSP_PRESHIFT"
        return LITERAL_RELOCATION.get(at.row.fields[self.letter].width, "UNSIGNED_10")

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        value = getattr(x, self.letter)
        if value < 0 and source:
            return [f"#{value}"]
        if value < 0:
            value &= (1 << at.row.fields[self.letter].width) - 1
        if self.high == 1023 and x.B:
            value &= 0xFF  # bits k<9:8>, which are illegal for bytes, are not shown
        return [f"#{value:#x}"]


@dataclass(frozen=True)
class Bit(Kind):
    """#bit4 of a W register, 0..15; 0..7 for a byte."""

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        return Part(1, text=tokens[0][1:].strip()) if tokens and tokens[0].startswith("#") else None

    def number(self, value: int, at: Site) -> dict[str, int]:
        high = 7 if at.byte else 15
        if not 0 <= value <= high:
            raise OperandError(f"bit #{value} is not in 0..{high}")
        return {"b": value}

    def relocation(self, at: Site) -> str:
        return "BIT_SELECT_4_BYTE" if at.byte else "BIT_SELECT_4"

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        return [f"#{x.b:#x}"]


def is_expression(token: str) -> bool:
    """Return whether a token can be an expression: it is no register, literal or indirect operand."""
    return not token.startswith(("#", "[")) and register_number(token) is None and token.upper() != "WREG"


@dataclass(frozen=True)
class FileAddress(Kind):
    """f: a data address. 13-bit forms reach 0x1FFF; word addresses are even."""

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        return Part(1, text=tokens[0]) if tokens and is_expression(tokens[0]) else None

    def number(self, value: int, at: Site) -> dict[str, int]:
        low, high = at.row.fields["f"].limits
        if not low <= value <= high:
            raise OperandError(f"address {value:#x} is not in {low:#x}..{high:#x}")
        if value % 2 and not at.byte:
            raise OperandError(f"word address {value:#x} is odd")
        return {"f": value}

    def relocation(self, at: Site) -> str:
        if at.row.fields["f"].width == 13:
            return "FILE_REG_BYTE" if at.byte else "FILE_REG"
        return "FILE_REG_WORD_WITH_DST" if {"s", "d"} & at.row.fields.keys() else "FILE_REG_WORD"

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        return [(symbol and symbol(x.f, "data")) or f"{x.f:#x}"]


@dataclass(frozen=True)
class FileBit(Kind):
    """``f, #bit4`` of the f-bit forms: two tokens. Bits 8..15 of a word are in the byte after f (isa.md §16)."""

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        if len(tokens) < 2 or not is_expression(tokens[0]) or not tokens[1].startswith("#"):
            return None
        return Part(2, text=tokens[0], bit=tokens[1][1:].strip())

    def bit(self, number: int | None, at: Site) -> tuple[int, int]:
        """Return the value of field b, and the offset to add to the address."""
        high = 7 if at.byte else 15
        if number is None or not 0 <= number <= high:
            raise OperandError(f"bit number must be a number in 0..{high}")
        return number & 7, number >> 3

    def number(self, value: int, at: Site) -> dict[str, int]:
        return FileAddress().number(value, at)

    def relocation(self, at: Site) -> str:
        return "FILE_REG_BYTE"

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        return [(symbol and symbol(x.f, "data")) or f"{x.f:#x}", f"#{x.b:#x}"]


@dataclass(frozen=True)
class Target(Kind):
    """Expr: a program address. It is encoded relative to the PC in branches and DO, absolute in CALL and GOTO."""

    def read(self, tokens: Sequence[str], at: Site) -> Part | None:
        return Part(1, text=tokens[0]) if tokens and is_expression(tokens[0]) else None

    def number(self, value: int, at: Site) -> dict[str, int]:
        if value % 2:
            raise OperandError(f"target {value:#x} is odd")
        if not at.row.fields["n"].signed:
            if not 0 <= value <= PC_MASK:
                raise OperandError(f"target {value:#x} is not in 0..{PC_MASK:#x}")
            return {"n": value}
        distance = value - (at.pc + 2 * at.row.words)
        words = ((distance & 0x7FFFFF ^ 0x400000) - 0x400000) // 2  # PC arithmetic is modulo 2**23, isa.md §7.1
        if not -0x8000 <= words <= 0x7FFF:
            raise OperandError(f"target {value:#x} is {words} words away, the limit is -32768..32767")
        if at.row.mnemonic == "DO" and words in (-2, -1, 0):
            raise OperandError("a DO loop needs at least two instructions")  # isa.md §7.6
        return {"n": words}

    def relocation(self, at: Site) -> str:
        if at.row.mnemonic == "DO":
            return "PCREL_DO"
        return "PCREL_BRANCH" if at.row.fields["n"].signed else "PGM_ADDR"

    def write(self, x: Operands, at: Site, symbol: SymbolOf | None, source: bool) -> list[str]:
        address = x.n
        if at.row.fields["n"].signed:
            address = at.pc + 2 * at.row.words + 2 * x.n
            if source:
                address &= 0x7FFFFF
        return [(symbol and symbol(address & 0x7FFFFF, "code")) or f"{address & 0xFFFFFFFF:#x}"]
